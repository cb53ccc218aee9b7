# SPDX-License-Identifier: Apache-2.0
"""Columns that say when a body was seen, and streams of two clocks."""

import numpy as np
import pytest
import yaml
from tables.imports import imported_csv
from tables.odd_files import PLACE, ROWS, TIMES_S, cells, table

from intent_recognition.tables import import_demonstrations, suggest_map
from intent_recognition.tables.flags import flags_of, seen_rows
from intent_recognition.tables.import_map import ImportMap

HIDDEN = (np.arange(ROWS) >= 70) & (np.arange(ROWS) < 80)
FLAGS = {
    "valid": ~HIDDEN * 1, "wrist_valid": ~HIDDEN, "wrist.is_tracked": ~HIDDEN * 1.0,
    "wristVisible": ~HIDDEN, "occluded": HIDDEN, "Wrist Occluded": HIDDEN * 1,
}  # fmt: skip


def of_flag(flag, said):
    """A table of a wrist, with the first place it had where it was hidden."""
    return table(
        f"t,wrist_x,wrist_y,wrist_z,q1,{flag}",
        lambda k: [f"{TIMES_S[k]}", *cells(0 if HIDDEN[k] else k), f"{k / ROWS}", f"{said[k]}"],
    )


@pytest.mark.parametrize(("flag", "said"), FLAGS.items())
def test_rows_in_which_a_body_was_not_seen_are_not_measured(flag, said, tmp_path):
    content = of_flag(flag, said)
    found, why = imported_csv(tmp_path, content, [f"wrist_{axis}" for axis in "xyz"], unit="mm")
    wanted = np.where(HIDDEN[:, None], np.nan, PLACE / 1000)
    np.testing.assert_allclose(found.values, wanted, atol=1e-8)
    assert f"by {flag} the body was not seen in some rows" in why
    text = suggest_map(tmp_path / "a.csv")
    mapping = ImportMap.from_dict(yaml.safe_load(text))
    _, made = import_demonstrations(tmp_path / "a.csv", mapping)
    wrist, joints = made.samples
    np.testing.assert_allclose(wrist.values, wanted, atol=1e-8)
    assert np.isfinite(joints.values).all()  # the arm was measured all the same
    assert f"# They say when a body was seen: {flag}" in text and "task: {column" not in text


def test_a_flag_of_another_body_or_that_is_no_flag_leaves_a_body_alone(tmp_path):
    for flag, said in {"cup_valid": ~HIDDEN, "visible": HIDDEN * 0.5, "valid": HIDDEN * 0}.items():
        columns = [f"wrist_{axis}" for axis in "xyz"]
        found, why = imported_csv(tmp_path, of_flag(flag, said), columns, unit="mm")
        assert np.isfinite(found.values).all() and "seen" not in why
    names = ["ann.valid", "ben.valid", "quality", "valid"]
    assert flags_of(names, "ann.position.x") == ["ann.valid", "valid"]
    for column in ("ann_px", "ann.qw", "annX", "annPosX", "Ann Rotation W", "ann_x [mm]"):
        assert flags_of(names, column) == ["ann.valid", "valid"], column
    assert seen_rows({"valid": np.array([1, 0])}, 3).all()  # of another length


def test_flags_count_for_columns_that_are_named_by_number(tmp_path):
    content = of_flag("wrist_valid", ~HIDDEN)
    found, _ = imported_csv(tmp_path, content, ["1", "2", "3"], unit="mm")
    assert np.array_equal(np.isnan(found.values[:, 0]), HIDDEN)


@pytest.mark.parametrize("shift_s", [-9.0, 9.0])
def test_streams_without_a_common_time_are_named(shift_s, tmp_path):
    for name, at_s in (("human", 0.0), ("robot", shift_s)):
        content = table("t,x,y,z", lambda k, at_s=at_s: [f"{TIMES_S[k] + at_s + 10}", *cells(k)])
        (tmp_path / f"{name}.csv").write_text(content)
    mapping = ImportMap.from_dict(yaml.safe_load(suggest_map(tmp_path)))
    said, made = import_demonstrations(tmp_path, mapping)
    first, second = [part.entry.topic for part in made.samples][:: 1 if shift_s > 0 else -1]
    assert f"{second} begins 7.01 s after the end of {first}." in said.reason
    assert len(made.samples) == 2
