# SPDX-License-Identifier: Apache-2.0
"""What is suggested of files as labs have them, and what it imports: the wrist, at 100 Hz."""

import json

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation
from tables.imports import suggested
from tables.odd_files import PLACE, ROWS, SHARE, TIMES_S, cells, csv_of, plain, table

from intent_recognition.tables import import_demonstrations, suggest_map
from intent_recognition.tables.import_map import ImportMap
from intent_recognition.tables.suggested_names import commanded

WRIST = PLACE / 1000


def opensim_vectors(row):
    vectors = ["{:.9f},{:.9f},{:.9f}".format(*WRIST[row]), "1,2,3"]
    return [f"{TIMES_S[row]:.3f}", *vectors]


def qualisys():
    values = [[*place, 0.4] for place in PLACE.tolist()]
    parts = [(1, values[:50]), (61, values[60:])]  # ten frames are not seen
    marker = [{"Range": {"Start": at}, "Values": part} for at, part in parts]
    still = [{"Range": {"Start": 1}, "Values": [[[1.0, 2.0, 3.0, 0.1], [1.0] * 9]] * ROWS}]
    time = {"Frequency": 100.0, "Range": {"Start": 1, "End": ROWS}}
    bodies = {"Markers": [{"Name": "wrist", "Parts": marker}],
              "RigidBodies": [{"Name": "cup", "Parts": still}]}  # fmt: skip
    return json.dumps({"File": "a.qtm", "Timebase": time, **bodies})


def of_ports():
    """NDI's, a row for each tool."""
    rows = ["Frame,Frame time (s),Port,Status,Tx,Ty,Tz\n"]
    for k, one in enumerate(PLACE):
        rows += [f"{k},{TIMES_S[k]:.3f},{port},OK,{','.join(map(str, place))}\n"
                 for port, place in (("0A", one), ("0B", [1, 2, 3]))]  # fmt: skip
    return "".join(rows)


def numbered_anew():
    """Bodies whose numbers change every 20 frames."""
    rows = zip(TIMES_S.tolist(), WRIST.tolist(), strict=True)
    return json.dumps([
        {"t": at, "bodies": [{"id": 1000 + k // 20, **dict(zip("xyz", place, strict=True))}]}
        for k, (at, place) in enumerate(rows)
    ])  # fmt: skip


TURNS = Rotation.from_rotvec(np.outer(TIMES_S, [0.5, 0.1, 0.0]))
QUATERNIONS = TURNS.as_quat()
LOST = np.roll(QUATERNIONS, 1, 1) * (np.arange(ROWS) % 9 > 2)[:, None]


def listed(head, *more, end=""):
    """A CSV of times, the wrist [m], and further columns."""
    return csv_of(head, TIMES_S, WRIST, *more, end=end)


def matrices():
    """Of poses, by row and column."""
    poses = np.tile(np.eye(4), (ROWS, 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = TURNS.as_matrix(), WRIST
    head = ",".join(["t", *(f"m{i}{k}" for i in range(4) for k in range(4))])
    return csv_of(head, TIMES_S, poses.reshape(-1, 16))


def of_frames(head, form):
    both = [f"{form.format(k / 100, k // 100, k % 100)},{n},{','.join(map(str, p))}\n"
            for k, one in enumerate(WRIST.tolist())
            for n, p in (("wrist", one), ("cup", [1, 2, 3]))]  # fmt: skip
    return "".join([f"{head},child,x,y,z\n", *both])


STO = "DataRate=100\nDataType=Vec3\nversion=3\nUnits=m\nendheader\ntime\twrist\tcup"
NDI = "Number of frames: 200\nFrequency: 100 Hz\nUnits: mm\nFrame,w x,w y,w z"


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.sto", table(STO, opensim_vectors, "\t")),
        ("a.json", qualisys()),
        ("a.csv", of_ports()),
        ("a.csv", table(NDI, lambda k: [str(k + 1), *cells(k)])),
        ("a.csv", "# sample rate: 30 Hz\n" + plain(head="time,x,y,z")),  # of another device
        ("b.json", numbered_anew()),
        ("b.json", json.dumps({"frameRate": 100, "rows": [{"w": one} for one in WRIST.tolist()]})),
        ("a.csv", listed("t,x,y,z,yaw,pitch,roll", SHARE, SHARE, SHARE)),
        ("a.csv", listed("t,X,Y,Z,A,B,C", SHARE, SHARE, SHARE)),
        ("a.csv", listed("t,a Tx,a Ty,a Tz,a Q0,a Qx,a Qy,a Qz", np.roll(QUATERNIONS, 1, 1))),
        ("a.csv", listed("", QUATERNIONS)),  # without names
        ("a.csv", matrices()),
        ("a.csv", of_frames("stamp,parent", "{0},w")),
        ("a.csv", of_frames("sec,nsec", "{1},{2}0000000")),
        ("a.csv", listed("t,pos_1,pos_2,pos_3,done,dq_1,dq_2", TIMES_S > 1, SHARE, SHARE)),
        ("a.csv", listed("t,a_x,a_y,a_z,a_Q0,a_Qx,a_Qy,a_Qz", LOST)),
        ("a.csv", listed("t,a_x,a_y,a_z,x,y,z,w", 16384 * QUATERNIONS)),  # as sensors send them
        ("a.csv", listed("time,x,y,z,EMG\ns,m,m,m,V", SHARE)),
        ("a.csv", listed(",w,,,cup,,\ntime,x,y,z,x,y,z\ns,m,m,m,m,m,m", WRIST + 1)),
        ("a.csv", listed("t,x,y,z", end="Note: dark,,,\nBy Ann,,,\n,,,\n")),
        ("a.csv", listed("t,x,y,z", end="\nMean,1,2,3\nSD,1,2,3\n")),
        ("a.csv", csv_of("t,x_m,y_m,z_mm", TIMES_S, WRIST * [1, 1, 1000])),
    ],
)
def test_the_wrist_of_an_exported_file_is_suggested(name, content, tmp_path):
    (tmp_path / name).write_text(content)
    _, _, (found,) = suggested(tmp_path / name)
    first = found.samples[0]
    seen = np.isfinite(first.values[:, 0])
    assert seen.sum() == (ROWS - 10 if name == "a.json" else ROWS)
    np.testing.assert_allclose(first.values[seen], WRIST[seen], atol=1e-8)
    np.testing.assert_allclose(first.stamps_ns - first.stamps_ns[0], 1e9 * TIMES_S, atol=1)
    assert not any(samples.entry.joints for samples in found.samples)


@pytest.mark.parametrize(
    ("place", "joints", "offsets"),
    [
        ("wrist_{}", ["elbow_flex", "wrist_flex", "wrist_roll"], [0, 1, 2]),
        ("{}", ["upper_arm_twist", "forearm_twist_joint"], [0, 1]),
        ("{}", ["joint_pos_1", "joint_pos_2", "joint_pos_3"], [0, 1, 2]),
        ("{}", [f"q{k}" for k in range(1, 8)], [0, -1, 0, 0, 3, 4, 5]),
        ("{}", ["pan", "tilt", "turn", "is_on"], [0, 0, 0, 1]),
    ],
)
def test_joints_that_resemble_an_orientation_are_suggested(place, joints, offsets, tmp_path):
    moves = 0.008 * SHARE.reshape(-1, 1) * [name != "is_on" for name in joints] + offsets
    head = ",".join(["t", *map(place.format, "xyz"), *joints])
    (tmp_path / "a.csv").write_text(listed(head, moves))
    told = ", ".join(name for name in joints if name != "is_on")
    assert f"joints: [{told}]" in suggest_map(tmp_path / "a.csv")


def test_names_that_patterns_would_take_long_for_are_passed_over(tmp_path):
    (tmp_path / "a.csv").write_text(listed(f"t,x,y,z,q1,{'_' * 60_000}", SHARE + [0, 1]))
    assert "joints: [q1]" in suggest_map(tmp_path / "a.csv")


def test_a_place_beside_a_quaternion_has_three_columns_and_no_time(tmp_path):
    path = tmp_path / "a.csv"
    counted = [np.arange(ROWS), TIMES_S, np.ones(ROWS), QUATERNIONS, WRIST]
    np.savetxt(path, np.column_stack(counted), delimiter=",")
    assert "columns: ['7', '8', '9']" in (text := suggest_map(path)) and text.count("/pose") == 1
    np.savetxt(path, np.column_stack([TIMES_S, QUATERNIONS, SHARE]), delimiter=",")
    assert "/pose" not in suggest_map(path)


def test_what_is_commanded_has_another_word_than_those_of_commands():
    assert commanded(["q_w", "state", "x_d", "x"]) == ["x_d"]


def test_columns_that_are_never_there_together_are_no_quaternion(tmp_path):
    """Topics at times of their own, as PlotJuggler writes them."""
    rows = (f"{t},{q},{q},{q},,\n{t + 0.005},,,,{q},{q}\n" for t, q in zip(TIMES_S, SHARE[:, 0]))
    (tmp_path / "a.csv").write_text("t,x,y,z,q1,q2\n" + "".join(rows))
    assert "joints: [q1, q2]" in suggest_map(tmp_path / "a.csv")


@pytest.mark.parametrize(
    ("since", "year", "rate_hz"),
    [
        (10**12, 2000.1, 30),
        (638_000_000_000_000_000, 2022.7, 30),
        (638_000_000_000_000_000, 2022.7, 100),  # no microseconds
        (133_000_000_000_000_000, 2022.5, 30),
    ],
)
def test_ticks_of_100_ns_are_times(since, year, rate_hz, tmp_path):
    """Of Kinect: since it started, of .NET since the year 1, of Windows since 1601."""
    at = lambda t: f"{since + round(1e9 * t / rate_hz)}"  # noqa: E731
    (tmp_path / "a.csv").write_text(plain(head="Timestamp,x,y,z", at=at))
    content, _, (found,) = suggested(tmp_path / "a.csv")
    assert content["time"] == {"column": "Timestamp", "unit": "ticks"}
    stamps = found.samples[0].stamps_ns
    np.testing.assert_allclose(stamps - stamps[0], 1e11 * TIMES_S / rate_hz, atol=100)
    assert stamps[0] / 1e9 / 86400 / 365.2425 + 1970 == pytest.approx(year, abs=0.1)


def landmarks(*last):
    """An array (T, n, d) of landmarks, the first of which is the wrist."""
    return np.stack([np.column_stack([one, *last]) for one in (PLACE, PLACE + 10.0)], axis=1)


@pytest.mark.parametrize(
    ("array", "axes"),
    [
        (landmarks(np.linspace(0.5, 1.0, ROWS)), 3),
        (landmarks()[..., :2], 2),
        (np.dstack([landmarks()[..., :2], np.linspace([0.0] * 2, [1.0] * 2, ROWS)]), 2),
    ],
)
def test_how_sure_landmarks_are_is_no_place_and_no_joint(array, axes, tmp_path):
    """In pixels what is not seen, with 0, is not measured."""
    np.savez(tmp_path / "a.npz", t=TIMES_S, k=array)
    text = suggest_map(tmp_path / "a.npz")
    content = yaml.safe_load(text)
    is_unsure = axes == 2 < array.shape[2]
    assert "joints" not in text and ("Note: the landmarks are places in" in text) == is_unsure
    assert content["observed"][0]["columns"] == [f"k.0.{k}" for k in range(axes)]
    *_, found = import_demonstrations(tmp_path / "a.npz", ImportMap.from_dict(content))
    values = found.samples[0].values
    assert np.isnan(values[0]).all() == is_unsure
    np.testing.assert_allclose(values[1:], WRIST[1:, :axes])


@pytest.mark.parametrize(
    ("shape", "is_transposed"),
    [
        ((4, 4), False), ((4, 4), True), ((16,), False), ((16,), True), ((3, 4), False),
        ((12,), False),
    ],
)  # fmt: skip
def test_matrices_of_poses_are_known_however_they_lie(shape, is_transposed, tmp_path):
    matrices = np.tile(np.eye(4), (ROWS, 1, 1))
    matrices[:, :3, :3], matrices[:, :3, 3] = TURNS.as_matrix(), WRIST
    matrices = (np.swapaxes(matrices, 1, 2) if is_transposed else matrices).reshape(ROWS, -1)
    array = matrices[:, : np.prod(shape)].reshape(-1, *shape)
    columns = {"O_T_EE": array, "q": np.cos(TIMES_S)[:, None] * np.ones(7)}
    np.savez(tmp_path / "a.npz", t=np.arange(ROWS), **columns)
    assert "# time: {rate: 100}" in suggest_map(tmp_path / "a.npz")  # a matrix T is no time t
    np.savez(tmp_path / "a.npz", t=TIMES_S, **columns)
    content, text, (found,) = suggested(tmp_path / "a.npz")
    np.testing.assert_array_equal(found.samples[0].values, WRIST)
    assert "positions: O_T_EE" not in text and len(content["controlled"][0]["joints"]) == 7
