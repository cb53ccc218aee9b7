# SPDX-License-Identifier: Apache-2.0
"""`intent import`: what a table holds is in the bags, to the last bit, and gaps are gaps."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest
import yaml
from bag_builder import write_ros1
from scipy.spatial.transform import Rotation

from intent_recognition.bags import BagReader
from intent_recognition.cli.main import main
from intent_recognition.demonstrations import load_dofs, read_demonstrations
from intent_recognition.errors import BagError, DofError
from intent_recognition.signals import LABEL
from intent_recognition.tables import import_demonstrations, load_map
from intent_recognition.tables.import_map import ImportMap
from intent_recognition.tables.times import SINCE_NS

WRIST = {
    "topic": "/mocap/wrist/pose",
    "type": "geometry_msgs/msg/PoseStamped",
    "fields": [f"pose.position.{axis}" for axis in "xyz"],
    "unit": "m",
    "columns": ["x", "y", "z"],
}
ARM = {
    "topic": "/joint_states", "type": "sensor_msgs/msg/JointState", "joints": ["elbow", "tool"],
    "unit": "rad", "columns": ["q0", "q1"],
}  # fmt: skip
MAP = {"observed": [WRIST], "controlled": [ARM], "time": {"column": "t"}, "task": "give"}


@pytest.fixture
def values(rng) -> dict[str, np.ndarray]:
    """Twelve rows; the wrist was not seen in two of them."""
    table = {name: rng.normal(size=12) * 0.01 for name in ("x", "y", "z", "q0", "q1")}
    table["t"] = 0.1 * np.arange(12)
    table["y"][4:6] = np.nan
    return table


def write_csv(path: Path, table: dict) -> Path:
    rows = zip(*(np.asarray(column).tolist() for column in table.values()), strict=True)
    lines = [",".join("" if v != v else str(v) for v in row) for row in rows]
    path.write_text("\n".join([",".join(table), *lines]) + "\n", encoding="utf-8")
    return path


def imported(source: Path, folder: Path, content: dict) -> list:
    """What the command makes of a source, read as training reads it."""
    path = folder / "map.yaml"
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    output = folder / "bags"
    assert main(["import", str(source), "--map", str(path), "--output", str(output)]) == 0
    found, rejections = read_demonstrations(output, load_dofs(output / "dofs.yaml"))
    assert not rejections
    return found


def check_rows(demonstration, table, rows=slice(None)):
    """The signals are the columns; rows with a gap are left out."""
    stamps = SINCE_NS + np.round(table["t"][rows] * 1e9).astype(np.int64)
    for (signal,), names in (
        (demonstration.observed, ("x", "y", "z")),
        (demonstration.controlled, ("q0", "q1")),
    ):
        wanted = np.column_stack([table[name][rows] for name in names])
        seen = np.all(np.isfinite(wanted), axis=1)
        assert np.array_equal(signal.values, wanted[seen])
        assert np.array_equal(signal.stamps_ns, stamps[seen])


def test_poses_with_y_up_are_turned_into_the_world(values, tmp_path):
    y_up = {"frame": "motive", "extrinsics": [f"motive 0 0 1 {0.5**0.5} 0 0 {0.5**0.5}"]}
    (found,) = imported(write_csv(tmp_path / "a.csv", values), tmp_path, MAP | y_up)
    wanted = np.column_stack([values["x"], -values["z"], values["y"] + 1.0])
    seen = np.isfinite(values["y"])
    np.testing.assert_allclose(found.observed[0].values, wanted[seen], atol=1e-12)


def test_joints_that_are_missing_are_left_out_of_the_message(values, tmp_path):
    values["q1"][3] = np.nan
    imported(write_csv(tmp_path / "reach.csv", values), tmp_path, MAP)
    messages = [m.message for m in BagReader(tmp_path / "bags/reach").messages(["joint_states"])]
    assert messages[3].name == ["elbow"] and list(messages[3].position) == [values["q0"][3]]
    assert messages[2].name == ["elbow", "tool"]


TURN = {
    **WRIST,
    "fields": [f"pose.orientation.{axis}" for axis in "xyzw"],
    "orientation": "quaternion",
    "unit": "rad",
    "columns": ["qx", "qy", "qz", "qw"],
}


def turned(values, rng) -> dict[str, np.ndarray]:
    quaternions = Rotation.from_rotvec(rng.normal(size=(12, 3)) * 0.2).as_quat()
    return values | dict(zip(TURN["columns"], quaternions.T, strict=True))


def test_a_whole_pose_goes_there_and_back(values, rng, tmp_path):
    table = turned(values, rng)
    content = MAP | {"observed": [WRIST, TURN], "controlled": []}
    (tmp_path / "map.yaml").write_text(yaml.safe_dump(content))
    source, mapped = write_csv(tmp_path / "reach.csv", table), tmp_path / "map.yaml"
    output, dofs = tmp_path / "bags", str(tmp_path / "bags/dofs.yaml")
    assert main(["import", str(source), "--map", str(mapped), "--output", str(output)]) == 0
    exported, again = str(tmp_path / "all.csv"), tmp_path / "again"
    assert main(["export", str(output), "--dofs", dofs, "--output", exported]) == 0
    mapped = str(tmp_path / "all.map.yaml")
    assert main(["import", exported, "--map", mapped, "--output", str(again)]) == 0
    seen = np.isfinite(values["y"])
    for folder in (output, again):
        messages = [m.message.pose for m in BagReader(folder / "reach").messages()]
        found = [[getattr(m.orientation, axis) for axis in "xyzw"] for m in messages]
        wanted = np.column_stack([table[name] for name in TURN["columns"]])[seen]
        np.testing.assert_allclose(found, wanted, atol=1e-12)
        assert [m.position.y for m in messages] == values["y"][seen].tolist()


def test_what_is_no_quaternion_is_refused(values, rng, tmp_path):
    table = turned(values, rng)
    for columns, said in (
        (["qw", "qx", "qy", "qz"], "those of x, y, z and w in this order"),
        (["qx", "qy", "qz"], "4 names"),
    ):
        with pytest.raises(DofError, match=f"expected {said}"):
            ImportMap.from_dict(MAP | {"observed": [WRIST, TURN | {"columns": columns}]})
    entry = TURN | {"columns": ["qx", "qy", "qz", "t"]}
    assert "no unit quaternion. Name its x, y, z and w" in wrong(tmp_path, table, observed=[entry])


def test_segments_and_labels_by_column(values, tmp_path):
    table = values | {"trial": ["1"] * 5 + [""] * 2 + ["2"] * 5, "what": ["A"] * 7 + ["B"] * 5}
    content = MAP | {
        "segments": {"column": "trial"},
        "task": {"column": "what"},
        "labels": {"A": "give", "B": "take"},
        "metadata": {"group": {"column": "what"}, "place": "lab"},
    }
    first, second = imported(write_csv(tmp_path / "day.csv", table), tmp_path, content)
    assert [(d.name, d.task) for d in (first, second)] == [("day_000", "give"), ("day_001", "take")]
    check_rows(first, values, slice(0, 5))
    check_rows(second, values, slice(7, 12))
    assert dict(second.metadata) == {"group": "B", "place": "lab", "imported_from": "day.csv"}


def test_segments_by_a_list_at_a_rate_and_thinned(values, tmp_path):
    del values["y"], values["t"]
    entry = WRIST | {"fields": ["pose.position.x", "pose.position.z"], "columns": ["x", "z"]}
    cuts = [{"start": 0.0, "end": 0.4, "task": "take"}, {"start": 0.5, "end": 1.1}]
    content = MAP | {"observed": [entry], "time": {"rate": 10}, "segments": cuts, "every": 2}
    first, second = imported(write_csv(tmp_path / "day.csv", values), tmp_path, content)
    assert (first.task, second.task) == ("take", "give")
    assert np.array_equal(first.observed[0].values[:, 0], values["x"][0:5:2])
    assert np.array_equal(second.observed[0].values[:, 0], values["x"][5:12:2])
    assert first.observed[0].stamps_ns.tolist() == [SINCE_NS + k * 200_000_000 for k in range(3)]


def test_several_files_make_one_recording(values, tmp_path):
    source = tmp_path / "set"
    (source / "monday").mkdir(parents=True)
    for number in ("07", "11"):
        write_csv(source / f"monday/wrist_{number}.csv", {k: values[k] for k in "txyz"})
        arm = {k: values[k] for k in ("t", "q0", "q1")}
        write_csv(source / f"monday/arm_{number}.csv", arm)
    write_csv(source / "monday/arm_12.csv", arm)
    content = MAP | {
        "files": {"wrist": "{day}/wrist_{no}.csv", "arm": "{day}/arm_{no}.csv"},
        "observed": [WRIST | {"file": "wrist"}],
        "controlled": [ARM | {"file": "arm"}],
    }
    found = imported(source, tmp_path, content)
    assert [d.name for d in found] == ["monday_07", "monday_11"]
    assert found[0].metadata["day"] == "monday" and found[0].metadata["no"] == "07"
    check_rows(found[1], values)
    left_out = [
        str(one)
        for one in import_demonstrations(source, load_map(tmp_path / "map.yaml"))
        if not hasattr(one, "samples")
    ]
    assert left_out == ["arm_12.csv: missing file: {day}/wrist_{no}.csv of the same recording"]


@pytest.mark.parametrize("rate", [5, 20])
@pytest.mark.parametrize("way", ["a task of rows", "a list of dates"])
def test_files_of_other_rates_and_beginnings_are_cut_at_the_same_times(way, rate, tmp_path):
    wrist, arm = np.arange(80) / 10, np.arange(-rate, 8 * rate) / rate
    day = np.datetime64("2024-01-31T10:00:00", "ns")
    write_csv(
        tmp_path / "wrist_0.csv",
        {"t": [str(day + round(s * 1e9)) for s in wrist], "x": wrist, "y": wrist, "z": 0.1 * wrist}
        | {"what": ["give" if s < 4.0 else "take" if s == 4.0 else "" for s in wrist]},
    )
    write_csv(
        tmp_path / "arm_0.csv",
        {"t": [str(day + round(s * 1e9)) for s in arm], "q0": arm, "q1": 0.1 * arm},
    )
    by_task = way == "a task of rows"
    cuts = [{"start": 0.0, "end": 3.95}, {"start": 4.0, "end": 7.95}]
    content = MAP | {
        "files": {"wrist": "wrist_{no}.csv", "arm": "arm_{no}.csv"},
        "observed": [WRIST | {"file": "wrist"}],
        "controlled": [ARM | {"file": "arm"}],
        **({"task": {"column": "what"}} if by_task else {"segments": cuts}),
    }
    parts = [*import_demonstrations(tmp_path, ImportMap.from_dict(content, "map"))]
    since_s = [[(s.stamps_ns - day.astype(np.int64)) / 1e9 for s in part.samples] for part in parts]
    for k, (seen, moved) in enumerate(since_s):
        wanted = arm[(arm >= 4.0) == k] if by_task else arm[(arm >= 4 * k) & (arm < 4 * k + 3.96)]
        np.testing.assert_allclose(seen, wrist[40 * k : 40 * k + 40], atol=1e-9)
        np.testing.assert_allclose(moved, wanted, atol=1e-9)
    assert len(since_s) == 2


@pytest.mark.parametrize("source", ["set", "set/fetch_box_0.csv"])
def test_a_file_name_is_divided_at_its_last_separator(source, values, tmp_path):
    (tmp_path / "set").mkdir()
    write_csv(tmp_path / "set/fetch_box_0.csv", values)
    content = {key: value for key, value in MAP.items() if key != "task"}
    for pattern in ("{task}_{number}.csv", "fetch_{task}_{number}.csv"):
        (found,) = imported(tmp_path / source, tmp_path, content | {"files": pattern})
        task = "box" if pattern.startswith("fetch") else "fetch_box"
        assert (found.name, found.task, found.metadata["number"]) == (f"{task}_0", task, "0")
        shutil.rmtree(tmp_path / "bags")


def test_units_are_converted_with_one_rounding(values, tmp_path):
    table = values | {axis: values[axis] * 1000 for axis in "xyz"}
    table |= {"q0": np.array([90.0] * 12)}
    content = MAP | {
        "observed": [WRIST | {"columns_unit": "mm"}],
        "controlled": [ARM | {"columns_unit": "deg"}],
    }
    (found,) = imported(write_csv(tmp_path / "a.csv", table), tmp_path, content)
    seen = np.isfinite(table["y"])
    assert np.array_equal(found.observed[0].values[:, 0], table["x"][seen] / 1000)
    assert np.allclose(found.controlled[0].values[:, 0], np.pi / 2, rtol=1e-15)
    with pytest.raises(DofError, match="parsec"):
        ImportMap.from_dict(MAP | {"observed": [WRIST | {"columns_unit": "parsec"}]})


def wrong(tmp_path, values, **changes) -> str:
    write_csv(tmp_path / "a.csv", values)
    (found,) = import_demonstrations(tmp_path / "a.csv", ImportMap.from_dict(MAP | changes))
    return str(found)


def test_a_wrong_map_names_the_columns_that_are_there(values, tmp_path):
    entry = WRIST | {"columns": ["x", "y", "wrist_z"]}
    reason = wrong(tmp_path, values, observed=[entry])
    assert "wrist_z" in reason and "x, y, z, q0, q1, t" in reason
    assert "seconds" in wrong(tmp_path, values, time={"column": "seconds"})
    assert "time in the map" in wrong(tmp_path, values, time={"column": "t", "since": 0})
    reason = wrong(tmp_path, values, task="a/b")
    assert f"expected {LABEL}, got 'a/b'. Give it another under labels" in reason
    outside = values | {"trial": ["a/../../evil"] * 12}
    assert "a name for a folder" in wrong(tmp_path, outside, segments={"column": "trial"})
    values["q0"] = ["fast"] * 12
    assert "'fast' in row 1" in wrong(tmp_path, values)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"tim": {}}, "only the keys"),
        ({"time": {"column": "t", "rate": 3}}, "either column or rate"),
        ({"time": {"column": "t", "unit": "h"}}, "one of s, ms, us, ns, min, ticks, samples"),
        ({"observed": [WRIST | {"columns": ["x"]}]}, "3 names"),
        ({"observed": [WRIST | {"file": "a"}]}, "under files"),
        ({"segments": [{"start": 2, "end": 1}]}, "a start before the end"),
        ({"segments": [{"start": 2}]}, "end: expected a number"),
        ({"every": 0}, "whole number from 1 on"),
        ({"files": {"a": "one.csv"}}, "placeholders"),
        ({"task": ["a"]}, "a text"),
    ],
)
def test_a_malformed_map_is_refused_in_one_line(changes, said):
    with pytest.raises(DofError, match=said) as caught:
        ImportMap.from_dict(MAP | changes)
    assert "\n" not in str(caught.value)


def test_it_says_how_to_go_on_and_what_has_no_task(values, tmp_path, capsys):
    for name in ("with", "none"):
        (tmp_path / name).mkdir()
    source = write_csv(tmp_path / "reach.csv", values)
    imported(source, tmp_path / "with", MAP)
    assert "with/bags/dofs.yaml" in (said := capsys.readouterr().out) and "without" not in said
    imported(source, tmp_path / "none", {k: v for k, v in MAP.items() if k != "task"})
    assert "1 without a task: name it under task" in " ".join(capsys.readouterr().out.split())


def test_what_was_written_is_counted_by_topic_and_what_was_not_is_said(values, tmp_path, capsys):
    values["t"][7] = values["t"][6]
    imported(write_csv(tmp_path / "reach.csv", values), tmp_path, MAP)
    said = capsys.readouterr().out
    assert re.search(r"reach +give +9 \+ 11 +2 +2", said)
    assert "/mocap/wrist/pose: 9 messages" in said and "/joint_states: 11 messages" in said


def test_a_map_is_suggested_and_asked_for(values, tmp_path, capsys):
    source = write_csv(tmp_path / "reach.csv", {**values, "what": ["give"] * 12})
    assert main(["import", str(source), "--output", str(tmp_path / "bags")]) == 1
    assert "--suggest writes a first map" in capsys.readouterr().err
    assert main(["import", str(source), "--suggest"]) == 0
    content = yaml.safe_load(text := capsys.readouterr().out)
    assert content["observed"][0]["columns"] == ["x", "y", "z"]
    assert content["controlled"][0]["columns"] == ["q0", "q1"]
    assert content["time"] == {"column": "t", "unit": "s"} and "it says: give" in text
    written = tmp_path / "new" / "map.yaml"
    assert main(["import", str(source), "--suggest", "--output", str(written)]) == 0
    assert "wrote" in capsys.readouterr().out and written.read_text(encoding="utf-8") == text
    written.write_text("corrected by hand", encoding="utf-8")
    assert main(["import", str(source), "--suggest", "--output", str(written)]) == 1
    assert "expected a new file" in capsys.readouterr().err
    assert written.read_text(encoding="utf-8") == "corrected by hand"


def test_bags_of_other_storages_get_labels_and_are_cut(tmp_path, capsys):
    for name in ("give_1.bag", "take_1.bag"):
        write_ros1(tmp_path / name)
    entries = {side: [{k: v for k, v in one.items() if k != "columns"} for one in MAP[side]]
               for side in ("observed", "controlled")}  # fmt: skip
    entries["controlled"][0]["joints"] = ["lwr_a1_joint", "lwr_a2_joint"]
    content = {**entries, "files": "{task}_{number}.bag"}
    found = imported(tmp_path, tmp_path, content)
    assert [(d.name, d.task) for d in found] == [("give_1", "give"), ("take_1", "take")]
    content["segments"] = [{"start": 0.0, "end": 0.1195}, {"start": 0.12, "end": 0.24}]
    shutil.rmtree(tmp_path / "bags")
    parts = imported(tmp_path, tmp_path, content)
    assert [d.name for d in parts] == ["give_1_000", "give_1_001", "take_1_000", "take_1_001"]
    assert parts[1].observed[0].stamps_ns.size == 13
    capsys.readouterr()
    content["segments"].append({"start": 7.0, "end": 8.0})
    shutil.rmtree(tmp_path / "bags")
    assert len(imported(tmp_path, tmp_path, content)) == 4
    assert "left out give_1_002: no message between start and end" in capsys.readouterr().out


def test_the_cure_is_said_once_where_nothing_can_be_imported(tmp_path, capsys):
    (tmp_path / "set").mkdir()
    for number in range(5):
        (tmp_path / f"set/a_{number}.csv").write_text("t,x,y\n")
    (tmp_path / "map.yaml").write_text(yaml.safe_dump(MAP), encoding="utf-8")
    paths = [str(tmp_path / name) for name in ("set", "map.yaml", "bags")]
    assert main(["import", paths[0], "--map", paths[1], "--output", paths[2]]) == 1
    said = capsys.readouterr().err
    assert "columns of the map, z, q0, q1 among them, got t, x, y (and 4" in said
    assert said.endswith("Correct the names in the map; --suggest writes one that has them.\n")


def test_an_empty_folder_and_a_taken_one(values, tmp_path, capsys):
    (tmp_path / "empty").mkdir()
    with pytest.raises(BagError, match=r"\.npy, \.parquet"):
        list(import_demonstrations(tmp_path / "empty", ImportMap.from_dict(MAP)))
    source = write_csv(tmp_path / "a.csv", values)
    imported(source, tmp_path, MAP)
    command = ["import", str(source), "--map", str(tmp_path / "map.yaml")]
    assert main([*command, "--output", str(tmp_path / "bags")]) == 1
    assert "which exists" in capsys.readouterr().err
