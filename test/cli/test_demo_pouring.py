# SPDX-License-Identifier: Apache-2.0
"""The pouring demo: a graph of nodes pours once; a table and a line."""

import json

import pytest

from intent_recognition.cli.main import main

pytestmark = pytest.mark.slow


def test_one_pour_is_told(tmp_path, capfd):
    numbers = tmp_path / "numbers.json"
    asked = ["demo", "--scenario", "pouring", "--interactions", "1", "--headless"]
    assert main([*asked, "--output", str(tmp_path), "--json", str(numbers)]) == 0
    told = capfd.readouterr().out
    assert "espresso cup into big bowl" in told
    assert "balls spilled" in told.splitlines()[-1]
    (one,) = json.loads(numbers.read_text(encoding="utf-8"))
    assert one["caught"] + one["kept"] + one["spilled"] == one["balls"] == 40
    assert one["second_parameters"]["opening_radius_m"] > 0.09
    assert one["kept"] <= 8  # a tenth of the cup's volume
    assert one["spilled"] <= 2
