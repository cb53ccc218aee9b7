# SPDX-License-Identifier: Apache-2.0
"""The examples of docs/warping.md run."""

import re
from pathlib import Path

import numpy as np

import intent_recognition as ir

PAGE = Path(__file__).resolve().parents[2] / "docs" / "warping.md"


def test_examples_run_one_after_the_other(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    session = {}
    blocks = re.findall(r"^```python\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.M | re.S)
    for block in blocks:
        exec(compile(block, str(PAGE), "exec"), session)
    assert len(blocks) == 3
    volume_m3, tilt_deg = map(float, capsys.readouterr().out.splitlines()[0].split())
    assert 1e-4 < volume_m3 < 1e-3
    assert 10.0 < tilt_deg < 60.0
    assert len(session["warped"].part(ir.Part.HANDLE)) > 0
    assert 0.002 < session["grasp"].width_m < 0.006
    assert (tmp_path / "cup.npz").is_file()
    assert np.isfinite(session["found"].lip_point).all()
