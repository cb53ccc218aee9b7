# SPDX-License-Identifier: Apache-2.0
"""The pouring demo: a graph of nodes pours once; a table and a line."""

import json

import pytest

from intent_recognition.cli.main import main


@pytest.mark.slow
@pytest.mark.long
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


@pytest.mark.parametrize(
    ("asked", "told"),
    [
        (["--record", "bag"], "--record"),
        (["--arm", "panda"], "--arm"),
        (["--pair", "mug"], "--pair"),
        (["--pour", "much"], "pour"),
        (["--model", "no.npz"], "no.npz"),
    ],
)
def test_what_it_cannot_do_is_said_before_anything_starts(asked, told, tmp_path, capfd):
    base = ["demo", "--scenario", "pouring", "--headless", "--output", str(tmp_path)]
    assert main([*base, *asked]) == 1
    assert told in capfd.readouterr().err
    assert not list(tmp_path.iterdir())
