# SPDX-License-Identifier: Apache-2.0
"""The first map of a file: what moves, when, and what its name tells."""

import re
from itertools import product
from pathlib import Path

import numpy as np
import pytest
import yaml
from bag_builder import joints, pose, write_pairs, write_ros1
from tables.exported_files import lerobot
from tables.imports import suggested, suggested_csv
from tables.odd_files import PLACE, ROWS, SHARE, TIMES_S, cells, csv_of, day_time, h5, plain, table

from intent_recognition.errors import BagError
from intent_recognition.signals import Rejection
from intent_recognition.tables import import_demonstrations, suggest_map
from intent_recognition.tables.import_map import ImportMap


def test_a_suggestion_knows_joints_from_clocks(tmp_path):
    others = [
        "header.stamp", "/js/panda_joint1/velocity", "gripper.pos", "nose_visibility",
        "obs.joint_pos_cos.0", "states.0", "cube_positions.0", "eef_quat.0", "id", "success_rate",
        "O_F_ext_hat_K0", "ExtTrq1", "ee_ori.0", "ee_states.3", "robot_states.0", "poses.9",
    ]  # fmt: skip
    head, n = ",".join(["__time", "/js/panda_joint1/position", *others]), np.arange(ROWS)
    columns = TIMES_S + 1.7e9, SHARE, n + 0.5, n % 7 + 0.2, n / 2, *[SHARE / 2] * 13
    content, text, _ = suggested_csv(tmp_path, csv_of(head, *columns))
    (entry,) = content["observed"]
    assert entry["joints"] == ["panda_joint1"] and "columns_unit" not in entry
    assert f"# They move, and are no positions: {', '.join(others[:12])}, and 4 more" in text


@pytest.mark.parametrize(
    ("columns", "joints"),
    [
        (("shoulder_deg", "elbow_deg"), ["shoulder", "elbow"]),
        (("shoulder [deg]", "elbow [deg]"), ["shoulder", "elbow"]),
        (("q1.degrees", "q2.degrees"), ["q1", "q2"]),
        (("elbow_rad", "wrist_rad"), ["elbow", "wrist"]),
        (("elbow_grad", "degree"), ["elbow_grad", "degree"]),
        (("hand.Rotation.Y", "hand.Rotation.Z"), ["hand_Rotation_Y", "hand_Rotation_Z"]),
        (("elbow_deg", "elbow_rad"), ["elbow_deg", "elbow_rad"]),
    ],
)
def test_joints_are_not_called_by_a_unit_that_is_converted(columns, joints, tmp_path):
    head = ",".join(("t", *columns))
    content, *_ = suggested_csv(tmp_path, csv_of(head, TIMES_S, SHARE, 1.0 - SHARE))
    assert content["observed"][0]["joints"] == joints
    assert content["observed"][0]["columns"] == list(columns)


def test_a_table_of_ros2_topic_echo_has_its_time(tmp_path):
    content = table("", lambda k: ["1700000000", f"{k * 10**6}", "world", *cells(k, scale=1e-3)])
    _, _, (found,) = suggested_csv(tmp_path, content.lstrip())
    assert found.samples[0].stamps_ns[3] == 1_700_000_000_003_000_000


NO_PLACES = {
    "BioWare\nDevice:,A,A,A\nRate (Hz):,100,100,100\nabs time,Fx,Fx12,Mx\ns,N,N,N": "Fx, Fx12, Mx",
    "t,Moment_X,Moment_Y,Moment_Z": "Moment_X, Moment_Y, Moment_Z",
    "t,COP_X,COP_Y,COP_Z": "COP_X, COP_Y, COP_Z",
    "Packet number,Bar (hPa),Power (dBm),X Axis (g)": "Bar (hPa), Power (dBm), X Axis (g)",
    "t,A.x [N],A.y [N],A.z [N]": "A.x [N], A.y [N], A.z [N]",
    "t,A.x,A.y,A.z\ns,N,N,N": "A.x, A.y, A.z",
    "t,FreeAcc_X,FreeAcc_Y,FreeAcc_Z": "FreeAcc_X, FreeAcc_Y, FreeAcc_Z",
    "t,Hand-V-x,Hand-V-y,Hand-V-z": "Hand-V-x, Hand-V-y, Hand-V-z",
}


@pytest.mark.parametrize("head", NO_PLACES)
def test_forces_and_sensors_are_neither_places_nor_joints(head, tmp_path):
    (tmp_path / "a.csv").write_text(table(head, lambda k: [f"{TIMES_S[k]}", *cells(k)]))
    with pytest.raises(BagError, match=re.escape(f"are no positions: {NO_PLACES[head]}.")):
        suggest_map(tmp_path / "a.csv")


def test_what_qtm_computed_is_named(tmp_path):
    head = "NO_OF_FRAMES\t9\nFREQUENCY\t100\nDATA_INCLUDED\tVelocity\nDATA_TYPES\thand_vel\n\n"
    rows = [f"{k + 1}\t{k / 100}\t{k * k}" for k in range(9)]
    (tmp_path / "a.tsv").write_text("\n".join([head, *rows]))
    with pytest.raises(BagError, match="no positions: Time, hand_vel"):
        suggest_map(tmp_path / "a.tsv")


def test_a_quaternion_with_its_axes_first_is_no_place(tmp_path):
    columns = TIMES_S, np.cos(SHARE), np.sin(SHARE), 0.0 * SHARE, 0.0 * SHARE
    (tmp_path / "a.csv").write_text(csv_of("t,W Part,X Part,Y Part,Z Part", *columns))
    with pytest.raises(BagError, match="Orientations: W Part, X Part"):
        suggest_map(tmp_path / "a.csv")


@pytest.mark.parametrize(
    ("shift", "last"), [(0.0, "wrist_visibility"), (-0.3, "wrist_visibility"), (0.0, "visible")]
)
def test_landmarks_that_are_shares_of_an_image_are_named(shift, last, tmp_path):
    columns = TIMES_S, shift + SHARE, 0.5 + 0.0 * SHARE, -SHARE, 0.9 + 0.0 * SHARE
    text = csv_of(f"t,wrist_x,wrist_y,wrist_z,{last}", *columns)
    _, said, _ = suggested_csv(tmp_path, text)
    assert ("places in the image" in said) == (shift == 0.0 and last != "visible")


def test_a_box_in_an_image_is_a_place(tmp_path):
    text = csv_of("t,x1,y1,w1", TIMES_S, PLACE)
    content, *_ = suggested_csv(tmp_path, text)
    assert content["observed"][0]["columns"] == ["x1", "y1"]


def test_delimiters_in_names_separate_no_cells(tmp_path):
    head = "t,Roll | Phi | X (deg),Pitch | Theta | Y (deg)"
    content, *_ = suggested_csv(tmp_path, csv_of(head, TIMES_S, SHARE, SHARE))
    assert content["observed"][0]["joints"] == ["Roll_Phi_X", "Pitch_Theta_Y"]


UR = ["base", "shoulder", "elbow", "wrist_1", "wrist_2", "wrist_3"]


@pytest.mark.parametrize(
    ("head", "joints"),
    [
        (",".join(["t", *UR]), UR),
        ("t,target_q_0,target_q_1,actual_q_0,actual_q_1", ["actual_q_0", "actual_q_1"]),
        ("t,q[0],q[1],q_d[0],q_d[1],dq[0],tau_J[1]", ["q_0", "q_1"]),
        ("t,j1_q,j2_q,j1_w,j2_w,theta1dot,eff_j1,ctrl0", ["j1_q", "j2_q"]),
        ("t,MeasuredJ1,MeasuredJ2,PlannedJ1,PlannedJ2", ["MeasuredJ1", "MeasuredJ2"]),
        ("t,hip_pitch,hip_roll,hip_yaw", ["hip_pitch", "hip_roll", "hip_yaw"]),
        ("t,j,d_j", ["j", "d_j"]),  # of a hand d
        ("", ["a", "b"]),  # ros2 topic echo
    ],
)
def test_joints_are_those_that_were_measured_in_one_entry(head, joints, tmp_path):
    values = 0.2 + SHARE * np.arange(1, 1 + (head.count(",") or 6))
    times = [f"{k / 100}" if head else f"7,{k}000000,base,a,b" for k in range(ROWS)]
    lines = [f"{t},{line}" for t, line in zip(times, csv_of("", values).splitlines(), strict=True)]
    content, *_ = suggested_csv(tmp_path, "\n".join([*filter(None, [head]), *lines]))
    assert [one["joints"] for one in content["observed"]] == [joints]
    assert "controlled" not in content and "columns_unit" not in content["observed"][0]


@pytest.mark.parametrize("head", ["x,y,z", "time,x,y,z", "time,q,x,y,z"])
def test_what_goes_on_evenly_is_no_time_as_a_place_or_beside_a_time_in_words(head, tmp_path):
    def row(k):
        even = [f"{k / 100}"] * (1 + ("q" in head))
        return [*["soon"] * ("time" in head), *even, *cells(k)[1:]]

    (tmp_path / "a.csv").write_text(table(head, row))
    assert "# time: {rate: 100}" in suggest_map(tmp_path / "a.csv")


def test_the_unit_of_the_header_is_suggested_where_another_were_usual(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(plain(head="time_ms,x,y,z", at=lambda t: f"{1e5 * t:.6g}"))  # 1 Hz
    assert "time: {column: time_ms, unit: ms}  # 1 Hz then" in suggest_map(path)


def test_a_map_is_suggested_of_bags(tmp_path):
    write_ros1(tmp_path / "give_00.bag")
    content = yaml.safe_load(suggest_map(tmp_path))
    doubt, found = import_demonstrations(tmp_path, ImportMap.from_dict(content))
    assert "lwr_a7_joint is at 6.24 rad, and its limits are" in doubt.reason
    assert content["files"] == "{task}_{number}.bag" and found.custom_data["task"] == "give"
    assert content["observed"][0]["topic"] == "/mocap/wrist/pose"
    assert len(content["controlled"][0]["joints"]) == 7
    (tmp_path / "give_00.bag").unlink()
    (tmp_path / "a.pkl").write_bytes(b"\x80\x04.")
    for path in (tmp_path, tmp_path / "a.pkl"):
        with pytest.raises(BagError, match="as CSV"):
            suggest_map(path)


def test_joints_without_a_name_of_their_own_are_left_out_of_a_map(tmp_path):
    names = ["", "elbow", "twice", "twice"]
    states = [joints(k, names=names, positions=[0.01 * k] * 4) for k in range(20)]
    write_pairs(tmp_path / "some", map(pose, range(20)), states)
    content = yaml.safe_load(suggest_map(tmp_path / "some"))
    assert content["controlled"][0]["joints"] == ["elbow"]
    unnamed = [{**state, "name": [""] * 4} for state in states]
    write_pairs(tmp_path / "none", map(pose, range(20)), unnamed)
    text = suggest_map(tmp_path / "none")
    assert "controlled:" not in text and "# Other topics: /joint_states" in text


def test_a_map_is_suggested_of_what_was_measured_not_commanded(tmp_path):
    joints = SHARE + np.arange(14) / 100
    places = {f"observations/{name}_pos": PLACE / 1000 for name in ("goal", "wrist")}
    h5(tmp_path / "give_0.hdf5", {"observations/qpos": joints, "action": joints} | places)
    content, text, _ = suggested(tmp_path)
    topics = [one["topic"] for side in ("observed", "controlled") for one in content[side]]
    assert topics == ["/mocap/goal/pose", "/mocap/wrist/pose", "/joint_states"]
    assert content["controlled"][-1]["columns"] == [f"observations.qpos.{k}" for k in range(14)]
    assert "# They move, and are no positions: action.0" in text


def test_what_was_recorded_at_another_rate_has_its_own_times(tmp_path):
    joints = np.repeat(SHARE, 5, axis=0) * [1.0, 2.0]
    arrays = {"human/time": TIMES_S, "human/wrist_pos": PLACE / 1000, "masses": np.arange(3.0)}
    arrays |= {"robot/time": np.arange(len(joints)) / 500, "robot/q": joints}
    arrays |= {"spectrum/hz": np.linspace(0.0, 50.0, 101), "spectrum/power": np.arange(101.0) ** 2}
    _, text, (found,) = suggested(h5(tmp_path / "a.h5", arrays))
    np.testing.assert_array_equal(found.samples[0].values, PLACE / 1000)
    np.testing.assert_array_equal(found.samples[1].values, joints)
    assert [samples.stamps_ns[5] - samples.stamps_ns[0] for samples in found.samples] == [5e7, 1e7]
    assert "# Of other lengths: spectrum.hz, spectrum.power, masses" in text


def test_times_that_begin_anew_in_each_demonstration_are_known(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.hdf5", "w") as file:
        file.create_group("data").attrs["env_args"] = "no JSON"
        for k in range(2):
            group = file.create_group(f"data/demo_{k}")
            group["time"], group["wrist_pos"] = TIMES_S, PLACE / 1000
    content, _, found = suggested(tmp_path / "a.hdf5")
    assert content["time"] == {"column": "time", "unit": "s"} and len(found) == 2
    np.testing.assert_allclose(np.diff(found[1].samples[0].stamps_ns), 10**7, atol=1)


def test_joints_of_two_files_have_names_of_their_own(tmp_path):
    for side in ("left", "right"):
        (tmp_path / side).mkdir()
        names = f"t,q1,q2,{side}"  # files with the same columns would be of one kind
        content = table(names, lambda k: [f"{TIMES_S[k]}", *[f"{SHARE[k, 0]}"] * 2, "a"])
        (tmp_path / side / "take_1.csv").write_text(content)
        (tmp_path / side / "take_2.csv").write_text(content)
    content, _, _ = suggested(tmp_path)
    entries = [*content["observed"], *content["controlled"]]
    assert [one["joints"] for one in entries] == [["q1", "q2"], ["q1_2", "q2_2"]]


def test_a_suggestion_knows_seconds_with_nanoseconds_and_dates(tmp_path):
    for head, stamp, wanted in (
        ("sec,nanosec", lambda k: f"{k // 100},{k % 100 * 10**7}", "nanosec"),
        ("ZeitSec,ZeitNanoSec", lambda k: f"{k // 100},{k % 100 * 10**7}", "ZeitNanoSec"),
        ("when", lambda k: f"2024-01-31 {day_time(TIMES_S[k])}", "when"),
        ("day,even", lambda k: f"2024-01-31 {day_time(TIMES_S[k])},{k / 100}", "day"),
    ):
        content = table(f"{head},x,y,z", lambda k, stamp=stamp: [stamp(k), *cells(k)])
        folder = tmp_path / wanted
        folder.mkdir()
        (folder / "a.csv").write_text(content)
        content, _, (found,) = suggested(folder / "a.csv")
        assert wanted in content["time"].values()
        stamps = found.samples[0].stamps_ns
        np.testing.assert_allclose(stamps - stamps[0], 1e9 * TIMES_S, atol=1)


@pytest.mark.parametrize(
    ("names", "pattern"),
    [
        (["give/1.csv", "give/2.csv", "take/1.csv"], "'{task}/{number}.csv'"),
        (["give_cup-07.csv", "take_cup-12.csv"], "'{task}-{number}.csv'"),
        (["give_00.csv"], "'{task}_{number}.csv'"),
        (["give.csv", "take_1.csv"], ""),
        (["give_20240131_100000.csv", "take_20240131_110000.csv"], "'{task}_{date}_{number}.csv'"),
        (["give_2024-01-31_10-00-00.csv"], "'{task}_{date}_{number}.csv'"),
        (["give_2024-01-31-10-00-00.csv"], "'{task}_{date}-{number}.csv'"),
        (["rosbag2_2024_01_31-10_00_00.csv", "rosbag2_2024_01_31-11_00_00.csv"], ""),
        (["2024-01-31_10-00-00.csv", "2024-01-31_11-00-00.csv"], ""),
        (["episode_0.csv", "episode_1.csv"], ""),
        (["P01/give_1.csv", "P02/give_1.csv"], ""),
        (["a/deep/x_1.csv", "b/deep/x_2.csv"], ""),
    ],
)
def test_a_suggested_map_reads_the_task_from_the_names(names, pattern, tmp_path):
    for name in names:
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("time,x,y,z\n0,0,0,0\n0.01,0.1,0,0\n0.02,0.3,0,0.1\n")
    text = suggest_map(tmp_path)
    told = [line.removeprefix("files: ") for line in text.splitlines() if line.startswith("files")]
    assert told == ([pattern] if pattern else [])
    assert ("task: give_it_a_name" in text) == (not pattern)
    mapping = ImportMap.from_dict(yaml.safe_load(text))
    found = list(import_demonstrations(tmp_path, mapping))
    assert found and not any(isinstance(one, Rejection) for one in found)
    tasks = {one.custom_data["task"] for one in found}
    assert tasks <= ({"give", "take", "give_cup", "take_cup"} if pattern else {"give_it_a_name"})


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (plain(head="t,x,x,x"), r"none but x, each twice\. Name columns by their numbers"),
        (plain(hidden=range(150, 160), cell="lost"), r"got none\..* got 'lost' in row 151"),
    ],
)
def test_why_nothing_is_suggested_is_named(content, said, tmp_path):
    (tmp_path / "a.csv").write_text(content)
    with pytest.raises(BagError, match=said):
        suggest_map(tmp_path / "a.csv")


def test_arrays_have_units_of_their_own_and_bodies_one(tmp_path):
    """A wrist in millimetres beside joints in radians, and a body near the origin."""
    near = 0.1 * (PLACE - PLACE[0])
    arrays = {"wrist": PLACE, "tray_pos": near, "q": np.repeat(SHARE, 6, axis=1), "t": TIMES_S}
    np.savez(tmp_path / "a.npz", **arrays, **{"next_obs.tray_pos": near})
    _, text, (found,) = suggested(tmp_path / "a.npz")
    assert "# The same, a step later, or as commanded: next_obs.tray_pos.0" in text
    for samples, wanted in zip(
        found.samples, (PLACE / 1000, near / 1000, arrays["q"]), strict=True
    ):
        np.testing.assert_allclose(samples.values, wanted, atol=1e-12)


@pytest.mark.parametrize(
    ("head", "at", "time"),
    [
        (",x,y,z", "{:.2f}".format, {"column": "0", "unit": "s"}),
        (",x,y,z", lambda t: f"2024-01-31 10:00:{t:06.3f}", {"column": "0"}),
        (",x,y,z", lambda t: f"{100 * t:.0f}", None),
        ("t,x,y,z", lambda t: f"{100 * t:.0f}", None),
        ("time,x,y,z", lambda t: f"{400 * t:.0f}", None),  # every fourth row, or milliseconds
        ("time,x,y,z", lambda t: f"{1000 * t:.0f}", {"column": "time", "unit": "ms"}),
        ("t,x,y,z", lambda t: f"{70_000 + 100 * t:.0f}", {"column": "t", "unit": "ms"}),
        ("n,x,y,z", lambda t: f"{1.7e12 + 1000 * t:.0f}", {"column": "n", "unit": "ms"}),
        ("t_ms,x,y,z", lambda t: f"{100 * t:.0f}", {"column": "t_ms", "unit": "ms"}),
        ("ms,x,y,z", lambda t: f"{1000 * t:.0f}", {"column": "ms", "unit": "ms"}),
        *(
            (f"{name},x,y,z", "{:.3f}".format, {"column": name, "unit": "s"})
            for name in ("temps", "czas (s)", "\N{CJK UNIFIED IDEOGRAPH-6642}")
        ),
        *(
            (head, lambda t, step=step: f"{100 * step * t:.0f}", None)  # counts every n-th row
            for head, step in ((",x,y,z", 2), ("n,x,y,z", 4), ("row,x,y,z", 10))
        ),
    ],
)
def test_a_first_column_is_the_time_in_any_language_unless_it_counts_rows(head, at, time, tmp_path):
    content = table(head, lambda k: [at(TIMES_S[k]), *cells(k, scale=1e-3)])
    (tmp_path / "a.csv").write_text(content)
    text = suggest_map(tmp_path / "a.csv")
    assert yaml.safe_load(text).get("time") == time and "joints" not in text


@pytest.mark.parametrize("labels", [("give/it", "take"), ("1", "2")])
def test_trials_and_labels_are_known_by_their_names(labels, tmp_path):
    """Neither a trial that is counted nor a time code that differs everywhere is anything else."""
    head = "t,time_code,world.frame_id,trial_id,task,x,y,z"

    def row(k):
        label = labels[k >= 120]
        return [f"{TIMES_S[k]}", f"c{k}", "world", f"{k // 40}", label, *cells(k, scale=1e-3)]

    content, text, found = suggested_csv(tmp_path, table(head, row))
    assert content["segments"] == {"column": "trial_id"} and "/joint_states" not in text
    assert "time_code" not in text and "frame_id" not in text
    found_labels = [one.custom_data["task"].replace("_", "/") for one in found]
    assert found_labels == [labels[0]] * 3 + [labels[1]] * 2


def test_a_label_that_names_no_task_leaves_its_demonstrations_out_alone(tmp_path):
    long = "put the black bowl between the plate and the ramekin onto the plate beside the stove"
    tasks = np.repeat([long, long + ".", "a/b", "a_b"], 50)
    trial = np.repeat(range(4), 50)
    np.savez(tmp_path / "a.npz", t=TIMES_S, w=PLACE / 1000, trial=trial, task=tasks)
    content, _, found = suggested(tmp_path / "a.npz")
    labels = [one.custom_data["task"] for one in found]
    assert len(set(labels)) == 4 and labels[3] == "a_b"
    del content["labels"]
    taken = import_demonstrations(tmp_path / "a.npz", ImportMap.from_dict(content))
    assert [isinstance(one, Rejection) for one in taken] == [True, True, True, False]


def test_what_is_measured_in_few_rows_is_seen_and_columns_that_are_twice_are_named(tmp_path):
    def row(k):
        return [f"{TIMES_S[k]}", *(cells(k, scale=1e-3) if k % 4 == 0 else [""] * 3), "1", f"{k}"]

    content, text, _ = suggested_csv(tmp_path, table("t,x,y,z,a,a", row))
    assert content["observed"][0]["columns"] == ["x", "y", "z"]
    assert "# There twice: name them by number: a" in text


@pytest.mark.parametrize(
    ("rows", "head", "end"),
    [
        (ROWS, "t,x,y,z", "wrist"), (ROWS - 1, "t,a x,a y,a z", "wrist"),
        (ROWS - 1, "t,x,y,z", "wrist"), (ROWS, "t,x,y,z", "fast"),
    ],
)  # fmt: skip
def test_files_with_one_number_are_of_one_recording(rows, head, end, tmp_path):
    """Those of other lengths and the same columns, or done otherwise, are tasks of a person."""
    for k in range(2):
        (tmp_path / f"give_{k}_{end}.csv").write_text(plain())
        lines = plain(head=head.replace("a ", "cup ")).splitlines(keepends=True)
        (tmp_path / f"give_{k}_cup.csv").write_text("".join(lines[: rows + 1]))
    content, _, found = suggested(tmp_path)
    if end == "fast" or (rows < ROWS and "a" not in head):
        assert len(found) == 4 and "controlled" not in content
        return
    assert content["observed"][0]["topic"] == "/mocap/cup/pose"
    assert content["controlled"][0]["topic"] == "/mocap/wrist/pose"
    assert [one.custom_data["task"] for one in found] == ["give", "give"]
    assert all(len(one.samples) == 2 for one in found)


@pytest.mark.parametrize(
    ("human", "robot"),
    [
        ("trial_{}/human.csv", "trial_{}/robot.csv"),
        ("reach_{}/human.csv", "reach_{}/robot.csv"),
        ("reach/{}/human.csv", "reach/{}/robot.csv"),
        ("human_{}.csv", "robot_{}.csv"),
    ],
)
def test_files_of_person_and_robot_are_of_one_recording(human, robot, tmp_path):
    """Unless most of their columns are the same, as those of two tasks are."""
    arm = csv_of("t,q1,q2", TIMES_S, SHARE, SHARE)
    two = {"tasks/pour_{}.csv": plain(), "tasks/reach_{}.csv": plain().replace("x,y,z", "x,y,z,no"),
           "apart/human_{}.csv": plain(), "apart/robot_{}0.csv": arm,
           "robot/robot_gives_{}.csv": plain(), "robot/robot_takes_{}.csv": plain(),
           "both/give_human_{}.csv": plain(), "both/give_robot_{}.csv": plain(),
           "both/take_human_{}.csv": plain(), "both/take_robot_{}.csv": plain(),
           "same/{}/human.csv": plain(), "same/{}/human.txt": arm,
           "alone/wrist.csv": plain(), "alone/robot_joints.csv": arm}  # fmt: skip
    one = {human: plain(), robot: arm, "{}/notes.json": '{"age": 3}'}
    contents = {**two, **{f"one/{name}": content for name, content in one.items()}}
    for path, content in [(tmp_path / n.format(k), c) for n, c in contents.items() for k in "12"]:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content)
    content, _, found = suggested(tmp_path / "one")
    assert [*content["files"]] == ["human", "robot"] and len(found) == 2
    assert content["observed"][0]["columns"] == ["x", "y", "z"]
    assert content["controlled"][0]["joints"] == ["q1", "q2"]
    task = "reach" if "reach_" in human else "give_it_a_name"
    assert {one.custom_data["task"] for one in found} == {task}
    for name in ("tasks", "apart", "robot", "both"):
        assert "files: '{task}_{number}.csv'" in suggest_map(tmp_path / name)
    assert ImportMap.from_dict(yaml.safe_load(suggest_map(tmp_path / "same")))
    assert "files:  # of one recording" in suggest_map(tmp_path / "alone")


NESTED = ("give_{}/{}.csv", "{}/{}.csv", "ann/{1}_{0}.csv", "p1/{1}_{0}.csv")
FLAT = ("{1}_{0}.csv", "give_{}_{}.csv", "{1}.csv", "give_{1}.csv")


@pytest.mark.parametrize("name", NESTED + FLAT)
@pytest.mark.parametrize(
    "kinds",
    [["human", "robot"], ["human", "robot_left", "robot_right"], ["robot_left", "robot_right"]],
)
def test_the_robots_files_may_have_the_columns_of_other_agents(name, kinds, tmp_path):
    for k, who in product((1, 2), kinds):
        path = tmp_path / name.format(k, who)
        path.parent.mkdir(exist_ok=True)
        path.write_text(plain())
    content, text, found = suggested(tmp_path)
    assert [one.removeprefix("give_") for one in content["files"]] == kinds
    assert len(found) == (2 if "{}" in name or "{0}" in name else 1)
    observed, *controlled = (*content["observed"], *content["controlled"])
    assert [one["file"].removeprefix("give_") for one in (observed, *controlled)] == kinds
    assert ("# Note: by their names all are of a robot." in text) == ("human" not in kinds)


def test_numbers_of_bodies_in_folders_of_recordings_are_no_numbers_of_recordings(tmp_path):
    arm = plain(head="t,q1,q2,q3")
    for k, (name, content) in product((1, 2), {"marker_1": plain(), "joints_1": arm}.items()):
        path = tmp_path / f"give_{k}/{name}.csv"
        path.parent.mkdir(exist_ok=True)
        path.write_text(content)
    content, _, found = suggested(tmp_path)
    assert content["files"]["marker_1"] == "{task}_{number}/marker_1.csv"
    assert [one.custom_data["task"] for one in found] == ["give", "give"]


def test_a_lone_recording_is_named_after_its_folder(tmp_path, monkeypatch):
    folder = tmp_path / "take"
    folder.mkdir()
    monkeypatch.chdir(folder)
    for who in ("human", "robot"):
        (folder / f"{who}.csv").write_text(plain())
    mapping = ImportMap.from_dict(yaml.safe_load(suggest_map(Path())))
    (found,) = import_demonstrations(Path(), mapping)
    assert found.name == "take"


@pytest.mark.parametrize("count", [1, 4])
def test_notes_and_other_files_beside_the_recordings_are_none(count, tmp_path):
    for k in range(count):
        (tmp_path / f"give_{k}.csv").write_text(plain())
    (tmp_path / "README.txt").write_text("Recorded by Ann on Monday, with the new markers.\n")
    (tmp_path / "ages.csv").write_text("subject,age\nAnn,30\nBob,31\n")
    (tmp_path / "camera.json").write_text('{"K": {"k1": 0.1}}')
    content, _, found = suggested(tmp_path)
    assert len(found) == count and found[0].custom_data["task"] == "give"
    assert content["observed"][0]["columns"] == ["x", "y", "z"]


@pytest.mark.parametrize(
    "first", [b"", b"t,x,y,z\n", bytes(9), plain(hidden=range(ROWS)).encode()],
    ids=["empty", "no rows", "no text", "not seen"],
)  # fmt: skip
def test_a_first_file_that_tells_nothing_leaves_it_to_the_others(first, tmp_path):
    for k in range(1, 4):
        (tmp_path / f"give_{k}.csv").write_text(plain())
    (tmp_path / "give_0.csv").write_bytes(first)
    whole = tmp_path / "give_1.csv"
    columns = yaml.safe_load(suggest_map(whole))["observed"]
    content = yaml.safe_load(suggest_map(tmp_path))
    assert content["observed"] == columns and content["files"] == "{task}_{number}.csv"
    taken = [*import_demonstrations(tmp_path, ImportMap.from_dict(content))]
    assert [isinstance(one, Rejection) for one in taken] == [True, False, False, False]


def test_a_first_file_that_is_empty_loses_no_agent(tmp_path):
    for k in range(3):
        (tmp_path / f"person_{k}.csv").write_text(plain() if k else "")
        (tmp_path / f"robot_{k}.csv").write_text(plain(head="t,tcp_x,tcp_y,tcp_z"))
    content = yaml.safe_load(suggest_map(tmp_path))
    assert content["observed"][0]["columns"] == ["x", "y", "z"]
    assert content["controlled"][0]["columns"] == ["tcp_x", "tcp_y", "tcp_z"]


def test_files_whose_names_match_no_recording_are_named(tmp_path):
    for name, head in (("person/give_0{}", "t,x,y,z"), ("robot/give_{}", "t,u,v,w")):
        for k in range(3):
            path = tmp_path / f"{name.format(k)}.csv"
            path.parent.mkdir(exist_ok=True)
            path.write_text(plain(head=head))
    assert "# Note: robot/give_0.csv and its like are left out" in suggest_map(tmp_path)


def test_files_of_the_system_are_no_recordings(tmp_path):
    (tmp_path / "give_1.csv").write_text(plain())
    for name in ("._give_1.csv", "~$give_1.csv", ".~lock.give_1.csv"):
        (tmp_path / name).write_bytes(b"\0\5\x16\7")
    _, _, found = suggested(tmp_path)
    assert len(found) == 1


@pytest.mark.parametrize(
    ("name", "at"),
    [
        ("ts", lambda k: 1.7e12 + 10 * k),
        ("t", lambda k: (k - k % 2) / 100),
        ("elapsed_s", lambda k: (k % 150) / 100),
    ],
)
def test_times_are_known_where_some_repeat_or_go_back(name, at, tmp_path):
    """Nor are they, or what counts rows from any number on, taken for joints."""
    rows = np.arange(ROWS)
    columns = at(rows), 70 + rows, PLACE / 1000, SHARE, 1 + 0 * rows, rows % 3
    (tmp_path / "a.csv").write_text(csv_of(f"{name},idx,x,y,z,vx,vy,vz", *columns))
    text = suggest_map(tmp_path / "a.csv")
    content = yaml.safe_load(text)
    assert content["time"]["column"] == name and "joints" not in text
    assert ("repeat or go back" in text) == (name != "ts")


def test_a_lerobot_set_without_tasks_is_read_and_asks_for_them(tmp_path):
    folder = lerobot(tmp_path)
    (folder / "meta/tasks.parquet").unlink()
    assert "task: {column: task}" in suggest_map(folder)
    parquet = pytest.importorskip("pyarrow.parquet")
    path = folder / "data/chunk-000/file-000.parquet"
    rows = parquet.read_table(path)
    parquet.write_table(rows.slice(0, rows.num_rows // 2), path)  # of one task
    text = suggest_map(folder)
    assert "# Note: there is no meta/tasks.jsonl" in text and "task: give_it_a_name" in text


def test_a_place_of_a_robot_beside_the_joints_of_another_is_no_lack_of_places(tmp_path):
    (tmp_path / "robot_left.csv").write_text(plain(head="t,q1,q2,q3"))
    (tmp_path / "robot_right.csv").write_text(plain())
    content, text, _ = suggested(tmp_path)
    assert content["observed"][0]["joints"] == ["q1", "q2", "q3"]
    assert "# Note: by their names all are of a robot." in text and "no places" not in text
