# SPDX-License-Identifier: Apache-2.0
"""C3D and LeRobot by their libraries, and what is said where one is missing."""

import json
import sys

import numpy as np
import pytest
from tables.exported_files import lerobot_set
from tables.test_import import ARM, MAP, WRIST, imported

from intent_recognition.tables import import_demonstrations
from intent_recognition.tables.files import find_tables, open_table
from intent_recognition.tables.import_map import ImportMap
from intent_recognition.tables.times import SINCE_NS

STATES = {"observed": [WRIST | {"columns": [f"observation.state.{axis}" for axis in "xyz"]}]}


@pytest.mark.parametrize(
    "module, package", [("pyarrow.parquet", "pyarrow"), ("ezc3d", "ezc3d"), ("h5py", "h5py")]
)
def test_a_missing_library_is_one_line_with_its_cure(module, package, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, module, None)
    if module == "ezc3d":
        monkeypatch.setattr("intent_recognition.tables.c3d.find_spec", lambda name: None)
    suffix = {"pyarrow": "parquet", "ezc3d": "c3d", "h5py": "h5"}[package]
    (tmp_path / f"a.{suffix}").write_bytes(b"PAR1")
    (left_out,) = import_demonstrations(tmp_path / f"a.{suffix}", ImportMap.from_dict(MAP))
    assert str(left_out).endswith(f"Install it: pip install {package}, or .[files] in a checkout.")


def test_c3d_markers_with_rate_unit_and_gaps_of_the_file(rng, tmp_path):
    c3d = pytest.importorskip("c3d")  # it writes here, and ezc3d reads
    points = (rng.normal(size=(20, 2, 3)) * 5 + 800).astype(np.float32)
    seen = np.ones((20, 2), bool)
    seen[6:9, 0] = False
    writer = c3d.Writer(point_rate=50.0)
    writer.set_point_labels(["R:WRI", "R:ELB"])
    for row, there in zip(points, seen, strict=True):
        frame = np.zeros((2, 5), np.float32)
        frame[:, :3], frame[:, 3] = row, np.where(there, 0.0, -1.0)
        writer.add_frames([(frame, np.empty((0, 0)))])
    writer.point_group.add_str("UNITS", "", "mm", 2)
    with (tmp_path / "reach.c3d").open("wb") as stream:
        writer.write(stream)
    entry = WRIST | {"columns": [f"R:WRI.{axis}" for axis in "xyz"]}
    content = {"observed": [entry], "task": "give"}
    (found,) = imported(tmp_path / "reach.c3d", tmp_path, content)
    (signal,) = found.observed
    assert np.array_equal(signal.values, points[seen[:, 0], 0].astype(np.float64) / 1000)
    ticks = 20_000_000 * np.flatnonzero(seen[:, 0])
    assert np.array_equal(signal.stamps_ns, SINCE_NS + ticks)
    data = (tmp_path / "reach.c3d").read_bytes()
    (tmp_path / "cut.c3d").write_bytes(data[:-600])
    said, _ = import_demonstrations(tmp_path / "cut.c3d", ImportMap.from_dict(content))
    assert said.reason == "13 of 20 frames: the file ends after them"
    (tmp_path / "other.c3d").write_bytes(b"another kind of file")
    (left_out,) = import_demonstrations(tmp_path / "other.c3d", ImportMap.from_dict(content))
    assert "expected a C3D file, got ezc3d says: File must be a valid c3d" in left_out.reason


@pytest.fixture(params=["v2.1", "v3.0"])
def lerobot(request, rng, tmp_path):
    """A data set of two episodes, and its states."""
    states = rng.normal(size=(2, 8, 5)).astype(np.float32) * np.float32(0.01)
    return lerobot_set(tmp_path / "set", states, list("xyzet"), request.param), states


def test_lerobot_by_its_own_metadata(lerobot, tmp_path):
    folder, states = lerobot
    names = [f"observation.state.{name}" for name in ("x", "y", "z", "e")]
    content = {
        "observed": [WRIST | {"columns": names[:3]}],
        "controlled": [ARM | {"columns": [names[3], "observation.state.4"]}],
        "labels": {"Hand me the plate.": "plate"},
    }
    found = imported(folder, tmp_path, content)
    assert [d.task for d in found] == ["Take the screw.", "plate"]
    for demonstration, state in zip(found, states, strict=True):
        assert np.array_equal(demonstration.observed[0].values, state[:, :3])
        assert np.array_equal(demonstration.controlled[0].values, state[:, 3:])
        ticks = np.rint((np.arange(8) / 10).astype(np.float32).astype(float) * 1e9)
        assert np.array_equal(demonstration.observed[0].stamps_ns, SINCE_NS + ticks)


@pytest.mark.parametrize("has_texts", [True, False])
def test_a_lerobot_episode_is_cut_where_its_task_changes(has_texts, lerobot):
    from pyarrow import parquet

    folder, states = lerobot
    path = min((folder / "data").rglob("*.parquet"))
    table = parquet.read_table(path)
    tasks = [1] * 3 + [0] * 2 + [1] * 3 + [0] * (table.num_rows - 8)  # the first episode has 8 rows
    at = table.column_names.index("task_index")
    parquet.write_table(table.set_column(at, "task_index", [tasks]), path)
    for path in (folder / "meta").glob("tasks.*" if not has_texts else "none"):
        path.unlink()
    taken = import_demonstrations(folder, ImportMap.from_dict(STATES))
    found = [one for one in taken if hasattr(one, "samples")]
    take, hand = "Take the screw.", "Hand me the plate."
    take, hand = (take, hand) if has_texts else ("task_index 1", "task_index 0")
    assert [one.custom_data["task"] for one in found] == [take, hand, take, hand]
    parts = np.split(states[0][:, :3], [3, 5])
    for one, part in zip(found, [*parts, states[1][:, :3]], strict=True):
        assert np.array_equal(one.samples[0].values, part)


@pytest.mark.parametrize("first", [[], [{"task_index": 0, "task": ""}]])
def test_a_lerobot_task_without_a_text_is_one_of_its_own(first, lerobot, tmp_path):
    folder, _ = lerobot
    tasks = [*first, {"task_index": 1, "task": "hand"}]
    (folder / "meta/tasks.jsonl").write_text("\n".join(map(json.dumps, tasks)))
    found = imported(folder, tmp_path, STATES)
    assert sorted(one.task for one in found) == ["hand", "task_index 0"]


@pytest.mark.parametrize("missing", ["task_index", "timestamp"])
def test_lerobot_without_tasks_or_times(missing, lerobot):
    from pyarrow import parquet

    folder, states = lerobot
    for path in (folder / "data").rglob("*.parquet"):
        parquet.write_table(parquet.read_table(path).drop_columns([missing]), path)
    *said, first, _ = import_demonstrations(folder, ImportMap.from_dict(STATES))
    assert [one.reason for one in said] == [
        "there is no column task_index: give the tasks in the map"
    ] * (missing == "task_index")
    assert np.array_equal(first.samples[0].values, states[0][:, :3])
    assert np.ptp(first.samples[0].stamps_ns) == pytest.approx(0.7e9, abs=100)


def test_frames_of_lerobot_that_were_not_downloaded_are_counted(lerobot):
    folder, states = lerobot
    info, there = json.loads((folder / "meta/info.json").read_text()), sum(map(len, states))
    for total, notes in ((there, ()), (there + 9, (f"there are {there} of {there + 9} frames",))):
        (folder / "meta/info.json").write_text(json.dumps(info | {"total_frames": total}))
        assert tuple(n.partition(":")[0] for n in open_table(folder).notes) == notes


def test_lerobot_of_another_version_or_place(lerobot):
    folder, _ = lerobot
    assert folder not in find_tables(folder / "meta")
    info = json.loads((folder / "meta/info.json").read_text())
    for change, said in (
        ({"codebase_version": "v1.6"}, "version 2 or 3"),
        ({"data_path": "../../{a}.parquet"}, "inside of the folder"),
        ({"features": None}, "features and data_path"),
    ):
        (folder / "meta/info.json").write_text(json.dumps(info | change))
        (left_out,) = import_demonstrations(folder, ImportMap.from_dict(MAP))
        assert said in left_out.reason
