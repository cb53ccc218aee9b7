# SPDX-License-Identifier: Apache-2.0
"""Files as labs send them: read right, or refused with what is wrong; never silently wrong."""

import json

import numpy as np
import pytest
import yaml
from bag_builder import write_ros1
from c3d_builder import c3d_file
from tables.exported_files import entry

from intent_recognition.errors import BagError
from intent_recognition.signals import Rejection
from intent_recognition.tables import Doubt, import_demonstrations, suggest_map
from intent_recognition.tables.import_map import ImportMap

ROWS = 200
TIMES_S = np.arange(ROWS) / 100
SHARE = np.clip(TIMES_S - 0.5, 0.0, 1.0)[:, None]
PLACE = np.array([300.0, 20.5, 900.0]) + SHARE**2 * (3 - 2 * SHARE) * np.array([300.0, 200, -100])
"""Of a wrist in millimetres, over time."""
NEXUS = "Trajectories\n100\n,,{0}:RWRA,,,{1}:RWRA,,\nFrame,Sub Frame,X,Y,Z,X,Y,Z\n,,mm,mm,mm,,,\n"
DEVICES = "Devices\n1000\n,,Plate - Force,,\nFrame,Sub Frame,Fx,Fy,Fz\n,,N,N,N\n"


def cells(k, form="{:.6f}", scale=1.0):
    return [form.format(value * scale) for value in PLACE[k]]


def table(head, row, separator=","):
    return head + "\n" + "".join(separator.join(row(k)) + "\n" for k in range(ROWS))


def day_time(seconds):
    return f"{seconds // 3600 % 24:02.0f}:{seconds // 60 % 60:02.0f}:{seconds % 60:06.3f}"


def plain(
    form="{:.6f}", scale=1.0, separator=",", head="t,x,y,z", hidden=(), cell="", at="{:.3f}".format
):
    def row(k):
        places = [cell] * 3 if k in hidden else cells(k, form, scale)
        return [at(TIMES_S[k]), *places]

    return table(head.replace(",", separator), row, separator)


def imported(folder, name, content, columns=("x", "y", "z"), **more):
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    unit = {"columns_unit": more.pop("unit")} if "unit" in more else {}
    observed = [entry(list(columns), **unit)]
    mapping = ImportMap.from_dict({"observed": observed, "task": "t", **more})
    found = list(import_demonstrations(path, mapping))
    taken = [one for one in found if not isinstance(one, Rejection)]
    said = " ".join(one.reason for one in found if isinstance(one, Rejection))
    return (taken[0].samples[0] if taken else None), said


def nexus(rows, owners=("Ann", "Bob"), before=""):
    body = "".join(f"{k + 1},0,{','.join(cells(k))},,,\n" for k in rows)
    return before + NEXUS.format(*owners) + body


PLAIN = {
    "thousands with a point": plain("{:,.3f}", 10.0, ";"),
    "thousands, quoted": plain('"{:,.3f}"', 10.0),
    "thousands of the Swiss": plain("{:,.3f}", 10.0, ";").replace(",", "'"),
    "thousands with blanks": plain("{:,.3f}", 10.0, ";").replace(",", "\N{NO-BREAK SPACE}"),
    "a row of units": plain(scale=10.0, head="t,x,y,z\ns,mm,mm,mm"),
    "comments": "# by me\n# on monday\n" + plain(scale=10.0),
    "a name behind a mark": plain(scale=10.0, head="# t,x,y,z"),
    "a comment and a name behind a mark": "# by me\n" + plain(scale=10.0, head="# t,x,y,z"),
    "a last row that is cut": plain(scale=10.0) + "2.00,3",
    "zero bytes at the end": plain(scale=10.0).encode() + bytes(40),
    "UTF-16 without a mark": plain(scale=10.0).encode("utf-16-le"),
    "UTF-16, big end first": plain(scale=10.0).encode("utf-16-be"),
    "bars": plain(scale=10.0, separator="|"),
    "Excel's line of the separator": "sep=;\n" + plain(scale=10.0, separator=";"),
    "titles": "Monday\n\nby me, of the plate\n".replace(",", "") + plain(scale=10.0),
    "times of day over midnight": plain(scale=10.0, at=lambda t: day_time(86_399.0 + t)),
    "dates with decimal commas": plain(
        scale=10.0, separator=";", at=lambda t: f"2024-01-31 {day_time(t)}"
    ).replace(".", ","),
}


@pytest.mark.parametrize("kind", PLAIN)
def test_a_csv_that_can_be_read_in_one_way_is(kind, tmp_path):
    time = {"time": {"column": "t"}}
    samples, said = imported(tmp_path, "a.csv", PLAIN[kind], unit="mm", **time)
    assert not said
    np.testing.assert_allclose(samples.values, PLACE / 100, atol=1e-5)
    np.testing.assert_allclose(samples.stamps_ns - samples.stamps_ns[0], 1e9 * TIMES_S, atol=1)


def test_a_line_of_one_name_is_no_title_above_numbers(tmp_path):
    content = plain(scale=10.0, head="t,,,")
    samples, said = imported(tmp_path, "a.csv", content, [1, 2, 3], unit="mm", time={"column": "t"})
    assert not said and len(samples.values) == ROWS


@pytest.mark.parametrize("name", ["x [mm]", "x (mm)", "x_mm"])
def test_a_unit_in_a_name_is_taken(name, tmp_path):
    names = [name.replace("x", axis) for axis in "xyz"]
    content = plain(head=",".join(["t", *names]))
    samples, said = imported(tmp_path, "a.csv", content, names, time={"column": "t"})
    assert not said
    np.testing.assert_allclose(samples.values, PLACE / 1000, atol=1e-8)


@pytest.mark.parametrize("cell", ["#N/A", "#DIV/0!", "-", "NaN", "inf"])
def test_cells_of_what_was_not_measured(cell, tmp_path):
    content = plain(hidden=range(60, 80), cell=cell)
    samples, said = imported(tmp_path, "a.csv", content, unit="mm", time={"column": "t"})
    assert not said
    assert np.sum(np.isfinite(samples.values).all(axis=1)) == ROWS - 20


REFUSED = {
    "thousands without decimals": (plain("{:,.0f}", 10.0, ";"), "thousands?"),
    "a number for what was not measured": (
        plain(hidden=range(60, 80), cell="-9999"),
        "stands in every column of 20 rows",
    ),
    "a line of names within": (plain() + plain(), "'x' in row 201"),
    "one row": ("t,x,y,z\n0,1,2,3\n", "empty: 1 sample with a time of its own"),
    "another kind of file": ("PK\3\4\0\0\0\1" * 20, "bytes that are no text"),
}


@pytest.mark.parametrize("kind", REFUSED)
def test_what_can_be_read_in_several_ways_is_refused(kind, tmp_path):
    content, words = REFUSED[kind]
    samples, said = imported(tmp_path, "a.csv", content, unit="mm", time={"column": "t"})
    assert samples is None
    assert words in said


def test_times_that_go_back_are_named(tmp_path):
    content = table("t,x,y,z", lambda k: [f"{k % 100 / 100}", *cells(k)])
    samples, said = imported(tmp_path, "a.csv", content, unit="mm", time={"column": "t"})
    assert len(samples.stamps_ns) == 100
    assert "100 of 200 rows" in said and "a clock that went back" in said


def test_a_clock_that_jumps_is_named(tmp_path):
    content = table("t,x,y,z", lambda k: [f"{k / 100 + 3600 * (k > 99)}", *cells(k)])
    samples, said = imported(tmp_path, "a.csv", content, unit="mm", time={"column": "t"})
    assert len(samples.stamps_ns) == ROWS and "no sample of mocap/wrist/pose for 3600 s" in said


def test_joints_in_degrees_are_doubted_and_wrapped_ones_are_not(tmp_path):
    angles = 3.0 + 1.0 * SHARE[:, 0]
    wrapped = (angles + np.pi) % (2 * np.pi) - np.pi
    content = table(
        "t,a,b", lambda k: [f"{TIMES_S[k]}", f"{30 + 60 * SHARE[k, 0]}", f"{wrapped[k]}"]
    )
    (tmp_path / "a.csv").write_text(content)
    for column, doubted in (("a", True), ("b", False)):
        joint = {
            "topic": "/joint_states", "type": "sensor_msgs/msg/JointState", "joints": [column],
            "unit": "rad", "columns": [column],
        }  # fmt: skip
        content = {"observed": [joint], "task": "t", "time": {"column": "t"}}
        *doubts, _ = import_demonstrations(tmp_path / "a.csv", ImportMap.from_dict(content))
        assert [one.reason.count("degrees for radians") for one in doubts] == [1] * doubted
        assert all(isinstance(one, Doubt) for one in doubts)


@pytest.mark.parametrize("before", ["", DEVICES + "1,0,1,2,3\n" * 300 + "\n"])
def test_nexus_counts_frames_wherever_its_places_are(before, tmp_path):
    rows = [k for k in range(ROWS) if not 80 <= k < 120]
    columns = [f"Ann:RWRA.{axis}" for axis in "XYZ"]
    samples, said = imported(tmp_path, "a.csv", nexus(rows, before=before), columns)
    assert not said
    np.testing.assert_allclose(samples.values, PLACE[rows] / 1000, atol=1e-8)
    steps = np.diff(samples.stamps_ns)
    assert steps.max() == 410_000_000 and np.median(steps) == 10_000_000


def test_a_marker_of_two_people_is_named_with_its_person(tmp_path):
    columns = [f"RWRA.{axis}" for axis in "XYZ"]
    samples, said = imported(tmp_path, "a.csv", nexus(range(ROWS)), columns)
    assert samples is None and "Ann:RWRA.X" in said and "Bob:RWRA.X" in said
    points = np.stack([PLACE, PLACE + 100.0], axis=1)
    for labels, known in ((["Ann:RWRA", "Bob:RWRA"], False), (["Ann:RWRA", "Ann:LWRA"], True)):
        content = c3d_file(points, labels=labels)
        samples, _ = imported(tmp_path, "a.c3d", content, [f"RWRA.{axis}" for axis in "xyz"])
        assert (samples is not None) == known


def test_zeros_of_a_hidden_marker_are_no_places_in_texts_either(tmp_path):
    head = "NO_OF_FRAMES\t200\nFREQUENCY\t100\nDATA_INCLUDED\t3D\nMARKER_NAMES\twrist\n"
    body = "".join("\t".join(cells(k) if k % 10 else ["0.000"] * 3) + "\n" for k in range(ROWS))
    columns = [f"wrist.{axis}" for axis in "xyz"]
    samples, said = imported(tmp_path, "a.tsv", head + body, columns)
    assert "(0, 0, 0) are taken for occlusion: wrist 20" in said
    assert np.sum(np.isnan(samples.values[:, 0])) == 20


def test_two_people_in_one_mvnx_are_refused(tmp_path):
    frame = '<frame time="0" type="normal"><position>0 0 0</position></frame>'
    person = f'<subject frameRate="100"><segments/><frames>{frame}</frames></subject>'
    samples, said = imported(tmp_path, "a.mvnx", f"<mvnx>{person}{person}</mvnx>")
    assert samples is None and "expected one person, got several" in said


def test_a_suggestion_knows_joints_from_clocks(tmp_path):
    head = "__time,header.stamp,/js/panda_joint1/position,/js/panda_joint1/velocity"
    content = table(
        head, lambda k: [f"{TIMES_S[k] + 1.7e9:.3f}", f"{k}.5", f"{SHARE[k, 0]}", f"{k % 7}.2"]
    )
    (tmp_path / "a.csv").write_text(content)
    text = suggest_map(tmp_path / "a.csv")
    (entry,) = yaml.safe_load(text)["observed"]
    assert entry["joints"] == ["panda_joint1"]
    assert "# They move, and are no positions: header.stamp, /js/panda_joint1/velocity" in text


def suggested(source):
    text = suggest_map(source)
    found = list(import_demonstrations(source, ImportMap.from_dict(yaml.safe_load(text))))
    assert found and not any(isinstance(one, Rejection) for one in found)
    return yaml.safe_load(text), text, found


def test_a_map_is_suggested_of_bags(tmp_path):
    write_ros1(tmp_path / "give_00.bag")
    content, _, (found,) = suggested(tmp_path)
    assert content["files"] == "{task}_{number}.bag" and found.custom_data["task"] == "give"
    assert content["observed"][0]["topic"] == "/mocap/wrist/pose"
    assert len(content["controlled"][0]["joints"]) == 7
    (tmp_path / "give_00.bag").unlink()
    with pytest.raises(BagError):
        suggest_map(tmp_path)


def test_a_map_is_suggested_of_what_was_measured_not_commanded(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "give_0.hdf5", "w") as file:
        file["observations/qpos"] = SHARE + np.arange(14) / 100
        file["observations/wrist_pos"] = file["observations/goal_pos"] = PLACE / 1000
        file["action"] = SHARE + np.arange(14) / 100
    content, text, _ = suggested(tmp_path)
    topics = [one["topic"] for side in ("observed", "controlled") for one in content[side]]
    assert topics == ["/mocap/goal/pose", "/mocap/wrist/pose", "/joint_states"]
    assert content["controlled"][-1]["columns"] == [f"observations.qpos.{k}" for k in range(14)]
    assert "# They move, and are no positions: action.0" in text


def test_bodies_of_one_name_have_topics_of_their_own(tmp_path):
    content = plain(head="t,obs.x,obs.y,obs.z").replace("\n", ",1,2,3\n")
    _, *rest = content.splitlines()
    rows = [",".join([*row.split(",")[:4], *row.split(",")[1:4]]) for row in rest]
    names = "t,obs.x,obs.y,obs.z,pose.x,pose.y,pose.z"
    (tmp_path / "a.csv").write_text("\n".join([names, *rows]) + "\n")
    content, *_ = suggested(tmp_path / "a.csv")
    assert content["observed"][0]["topic"] == "/mocap/wrist/pose"
    assert content["controlled"][0]["topic"] == "/mocap/wrist_2/pose"


ARRAYS = {
    "places of landmarks (T, n, 3)": ({"w": np.stack([PLACE, PLACE / 1000], axis=1)}, "w.1.{}"),
    "an image beside it": ({"w": PLACE / 1000, "i": np.zeros((ROWS, 8, 8))}, "w.{}"),
    "time differences": ({"w": PLACE / 1000, "t": (1e9 * TIMES_S).astype("m8[ns]")}, "w.{}"),
    "dates from 1970 on": ({"w": PLACE / 1000, "t": (1e9 * TIMES_S).astype("M8[ns]")}, "w.{}"),
}


@pytest.mark.parametrize("kind", ARRAYS)
def test_arrays_of_any_layout(kind, tmp_path):
    arrays, name = ARRAYS[kind]
    np.savez(tmp_path / "made.npz", **{"t": TIMES_S, **arrays})
    content = (tmp_path / "made.npz").read_bytes()
    columns = [name.format(k) for k in range(3)]
    samples, said = imported(tmp_path, "a.npz", content, columns, time={"column": "t"})
    assert not said
    np.testing.assert_allclose(samples.values, PLACE / 1000)
    np.testing.assert_allclose(samples.stamps_ns - samples.stamps_ns[0], 1e9 * TIMES_S, atol=1)


def test_samples_in_columns_are_named(tmp_path):
    np.savez(tmp_path / "made.npz", w=PLACE.T)
    content = (tmp_path / "made.npz").read_bytes()
    _, said = imported(tmp_path, "a.npz", content, ["w.0", "w.1", "w.2"], time={"rate": 100})
    assert "w has 3 rows and 200 columns" in said and "transpose it" in said


def test_a_replay_buffer_is_cut_and_fields_of_records_are_columns(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.hdf5", "w") as file:
        file["data/eef_pos"], file["meta/episode_ends"] = PLACE / 1000, [80, ROWS]
    records = np.array(list(map(tuple, PLACE / 1000)), [(axis, float) for axis in "xyz"])
    with h5py.File(tmp_path / "b.hdf5", "w") as file:
        file["w"] = records
    entry = {"topic": "/p", "type": "geometry_msgs/msg/Point", "fields": list("xyz"), "unit": "m"}
    for name, columns, lengths in (
        ("a", [f"data.eef_pos.{k}" for k in range(3)], [80, ROWS - 80]),
        ("b", ["w.x", "w.y", "w.z"], [ROWS]),
    ):
        mapping = {"observed": [{**entry, "columns": columns}], "task": "t", "time": {"rate": 100}}
        found = import_demonstrations(tmp_path / f"{name}.hdf5", ImportMap.from_dict(mapping))
        parts = [one.samples[0].values for one in found]
        assert list(map(len, parts)) == lengths
        np.testing.assert_array_equal(np.concatenate(parts), PLACE / 1000)


def landmarks(k, value=None):
    points = [{"x": 0.0, "y": 0.0, "z": 0.0} for _ in range(33)]
    points[16] = dict(zip("xyz", (PLACE[k] / 1000).tolist() if value is None else value * 3))
    return points


def frames(scale=1.0, key="worldLandmarks"):
    return [{"timestamp": scale * t, key: [landmarks(k)]} for k, t in enumerate(TIMES_S.tolist())]


JSON = {
    "with a mark": (b"\xef\xbb\xbf" + json.dumps(frames()).encode(), ""),
    "in UTF-16": (json.dumps(frames()).encode("utf-16"), ""),
    "in milliseconds": (json.dumps(frames(1e3)), ""),
    "in microseconds": (json.dumps(frames(1e6)), ""),
    "a frame on each line": ("\n".join(map(json.dumps, frames())), ""),
    "frames by their number": (json.dumps({str(k): f for k, f in enumerate(frames())}), ""),
    "of the image": (json.dumps(frames(key="landmarks")), "places in the image, not in metres"),
}


@pytest.mark.parametrize("kind", JSON)
def test_landmarks_in_any_json(kind, tmp_path):
    content, words = JSON[kind]
    columns = [f"right_wrist.{axis}" for axis in "xyz"]
    samples, said = imported(tmp_path, "a.json", content, columns)
    assert said == (said if words else "") and words in said
    np.testing.assert_allclose(samples.values, PLACE / 1000)
    np.testing.assert_allclose(samples.stamps_ns - samples.stamps_ns[0], 1e9 * TIMES_S, atol=200)


@pytest.mark.parametrize(
    "content",
    ["null", "3", "[[]]", '{"fps": "a", "frames": [[[0, 0]]]}', json.dumps([landmarks(0, "abc")])],
)
def test_json_of_something_else_is_refused(content, tmp_path):
    assert imported(tmp_path, "a.json", content, time={"rate": 100})[0] is None


def test_a_marker_that_was_never_seen_is_named_and_labels_may_be_latin(tmp_path):
    content = c3d_file(np.stack([0.0 * PLACE, PLACE], axis=1), labels=["W", "H\xe4nd"])
    columns = [f"W.{axis}" for axis in "xyz"]
    assert "(0, 0, 0) in every frame" in imported(tmp_path, "a.c3d", content, columns)[1]
    samples, said = imported(tmp_path, "a.c3d", content, [f"H\xe4nd.{axis}" for axis in "xyz"])
    assert not said and len(samples.values) == ROWS


def test_a_suggestion_knows_seconds_with_nanoseconds_and_dates(tmp_path):
    for head, stamp, wanted in (
        ("sec,nanosec", lambda k: f"{k // 100},{k % 100 * 10**7}", "nanosec"),
        ("when", lambda k: f"2024-01-31 {day_time(TIMES_S[k])}", "when"),
    ):
        content = table(f"{head},x,y,z", lambda k, stamp=stamp: [stamp(k), *cells(k)])
        folder = tmp_path / wanted
        folder.mkdir()
        (folder / "a.csv").write_text(content)
        content, _, (found,) = suggested(folder / "a.csv")
        assert wanted in content["time"].values()
        stamps = found.samples[0].stamps_ns
        np.testing.assert_allclose(stamps - stamps[0], 1e9 * TIMES_S, atol=1)
