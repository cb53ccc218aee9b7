# SPDX-License-Identifier: Apache-2.0
"""Arrays in any layout: read right, or what is odd is named."""

import numpy as np
import pytest
from scipy.io import savemat
from tables.exported_files import entry
from tables.imports import check_wrist, demonstrations, imported, suggested
from tables.odd_files import PLACE, ROWS, SHARE, TIMES_S, h5, mat

from intent_recognition.tables import import_demonstrations, suggest_map
from intent_recognition.tables.files import open_table
from intent_recognition.tables.hdf5_reading import read
from intent_recognition.tables.import_map import ImportMap

ARRAYS = {
    "places of landmarks (T, n, 3)": ({"w": np.stack([PLACE, PLACE / 1000], axis=1)}, "w.1.{}"),
    "poses of bodies (T, n, 7)": (
        {"w": np.dstack([np.stack([PLACE, PLACE / 1000], axis=1), np.full((ROWS, 2, 4), 0.5)])},
        "w.1.{}",
    ),
    "one body (T, 1, d)": ({"w": PLACE[:, None] / 1000}, "w.{}"),
    "landmarks (T, 3, n)": ({"w": np.repeat(PLACE[..., None] / 1000, 9, axis=2)}, "w.8.{}"),
    "an image beside it": ({"w": PLACE / 1000, "i": np.zeros((ROWS, 8, 8))}, "w.{}"),
    "fields": (
        {"w": np.rec.fromarrays([TIMES_S, PLACE / 1000], dtype=[("s", "f8"), ("at", "f8", 3)])},
        "w.at.{}",
    ),
    "time differences": ({"w": PLACE / 1000, "t": (1e9 * TIMES_S).astype("m8[ns]")}, "w.{}"),
    "dates from 1970 on": ({"w": PLACE / 1000, "t": (1e9 * TIMES_S).astype("M8[ns]")}, "w.{}"),
}


@pytest.mark.parametrize("kind", ARRAYS)
def test_arrays_of_any_layout(kind, tmp_path):
    arrays, name = ARRAYS[kind]
    np.savez(tmp_path / "a.npz", **{"t": TIMES_S, **arrays})
    columns = [name.format(k) for k in range(3)]
    found = imported(tmp_path, "a.npz", None, columns, time={"column": "t"})
    check_wrist(found, times_atol=1)


def test_a_cloud_and_features_are_no_columns(tmp_path):
    shapes = {"of_matlab": (3, 1024), "features": (1, 10_001), "with_colours": (2048, 6)}
    arrays = {"w": PLACE, **{name: np.ones((ROWS, *shape)) for name, shape in shapes.items()}}
    np.savez(tmp_path / "a.npz", **arrays)
    h5(tmp_path / "a.h5", arrays)
    for name in ("a.npz", "a.h5"):
        assert open_table(tmp_path / name).names == ("w.0", "w.1", "w.2")


SIDE = {"t": 1e3 * TIMES_S, "w": PLACE / 10}
UNITS = {
    "of arrays": (SIDE, {"w": "cm", "t": "ms"}, "w.{}"),
    "of elements": (SIDE, {"w": ["cm", "Centimeters", "cm"], "t": np.bytes_("ms")}, "w.{}"),
    "of the file": (SIDE, {"/": "cm", "t": "milliseconds"}, "w.{}"),
    "of a group": (
        {"t": 1e3 * TIMES_S, "hand/w": PLACE / 10, "q": SHARE[:, 0]},
        {"hand": "cm", "t": "ms", "q": "rad"},
        "hand.w.{}",
    ),
    "of demonstrations": (
        {f"data/demo_{k}/{name}": array for k in range(2) for name, array in SIDE.items()},
        {f"data/demo_{k}/{name}": {"w": "cm", "t": "ms"}[name] for k in range(2) for name in SIDE},
        "w.{}",
    ),
    "of fields": (
        {"r": np.rec.fromarrays([1e3 * TIMES_S, *(PLACE / [10, 1, 1]).T], names="t,w0,w1,w2")},
        {"r": ["ms", "cm", "mm", "mm"]},
        "r.w{}",
    ),
    "in names": ({"t_ms": 1e3 * TIMES_S, "w_cm": PLACE / 10}, {}, "w_cm.{}"),
}  # fmt: skip


@pytest.mark.parametrize("kind", UNITS)
def test_units_that_hdf5_states_are_converted(kind, tmp_path):
    arrays, units, name = UNITS[kind]
    h5(tmp_path / "a.h5", arrays, units)
    time = {"of fields": "r.t", "in names": "t_ms"}.get(kind, "t")
    columns = [name.format(k) for k in range(3)]
    found = imported(tmp_path, "a.h5", None, columns, time={"column": time})
    check_wrist(found, times_atol=1)


@pytest.mark.parametrize("units", [("parsec", "parsec"), ("mm", "m"), ("mm", "")])
def test_a_unit_of_hdf5_that_is_unknown_or_differs_is_refused(units, tmp_path):
    made = {f"demo_{k}/w": PLACE for k in range(2)}
    stated = {f"demo_{k}/w": unit for k, unit in enumerate(units)}
    h5(tmp_path / "a.h5", made, stated)
    options = {"columns": ["w.0", "w.1", "w.2"], "time": {"rate": 100}}
    samples, said = imported(tmp_path, "a.h5", None, **options)
    assert samples is None and "expected a unit of w.0 that becomes m" in said
    samples, _ = imported(tmp_path, "a.h5", None, unit="mm", **options)
    np.testing.assert_allclose(samples.values, PLACE / 1000)


TRIALS = [{"t": TIMES_S[: ROWS - k], "w": PLACE[: ROWS - k] / 10, "units": "cm"} for k in range(3)]
SAID = {
    "MAT": ({"t": TIMES_S, "w": PLACE / 10, "Units": "cm"}, "w.{}", "t"),
    "a struct": ({"s": TRIALS[0]}, "s.w.{}", "s.t"),
    "an array of structs": ({"s": TRIALS}, "s.w.{}", "s.t"),
    "two trials of one length": ({"trials": [TRIALS[0]] * 2}, "trials.w.{}", "trials.t"),
    "cells": ({k: [one[k] for one in TRIALS] for k in ("t", "w")} | {"unit": "cm"}, "w.{}", "t"),
    "NPZ": ({"t": TIMES_S, "w": PLACE / 10, "unit": "cm"}, "w.{}", "t"),
}


@pytest.mark.parametrize("version", [5, 7.3])
@pytest.mark.parametrize("kind", SAID)
def test_a_text_beside_arrays_says_their_unit(kind, version, tmp_path):
    content, name, time = SAID[kind]
    path = tmp_path / ("a.npz" if kind == "NPZ" else "a.mat")
    if path.suffix == ".npz":
        np.savez(path, **content)
    else:
        mat(path, content, version)
    columns = [name.format(k) for k in range(3)]
    content = {"observed": [entry(columns)], "task": "t", "time": {"column": time}}
    first, *others = import_demonstrations(path, ImportMap.from_dict(content))
    np.testing.assert_allclose(first.samples[0].values, PLACE / 1000)
    count = {"an array of structs": 2, "cells": 2, "two trials of one length": 1}.get(kind, 0)
    assert len(others) == count


@pytest.mark.parametrize("version", [5, 7.3])
def test_arrays_of_mat_have_their_axes_in_matlabs_order(version, tmp_path):
    joints, places = np.repeat(PLACE, 10, axis=1), np.stack([PLACE, PLACE + 1.0], axis=1) / 1000
    content = {"q": joints, "t": TIMES_S, "w": places, "seen": SEEN}
    path = mat(tmp_path / "a.mat", content, version)
    if version == 7.3:  # what another program added
        with pytest.importorskip("h5py").File(path, "a") as file:
            file["z/n"], file["z/of"] = np.arange(3), np.arange(4)
    assert open_table(path).names == (
        *(f"q.{k}" for k in range(30)), "t", *WHERE,
        *(("z.n", "z.of") if version == 7.3 else ()),
    )  # fmt: skip
    samples, _ = imported(tmp_path, "a.mat", None, WHERE[3:], time={"column": "t"})
    np.testing.assert_array_equal(samples.values, places[:, 1])


@pytest.mark.parametrize("count", [2, 4])
def test_places_of_a_few_markers_in_matlabs_order(count, tmp_path):
    places = np.stack([PLACE / 1000 + 0.01 * k for k in range(count)], axis=2)
    turns = np.dstack([np.tile(np.eye(3), (ROWS, 1, 1)), PLACE / 1000])
    quaternions = np.tile([0.6, 0.0, 0.8, 0.0], (ROWS, 3, 1))
    path = mat(tmp_path / "a.mat", {"w": places, "pose": turns, "q": quaternions}, 5)
    samples, _ = imported(tmp_path, "a.mat", None, [f"w.1.{k}" for k in range(3)], time={"rate": 9})
    np.testing.assert_array_equal(samples.values, places[:, :, 1])
    found = open_table(path)
    assert {"pose.2.3", "q.2.3"} < {*found.names} and "pose.3.0" not in found.names


@pytest.mark.parametrize("shape", [(6, 7), (7, 7), (3, 6)])
def test_jacobians_and_mass_matrices_are_no_joints(shape, rng, tmp_path):
    arrays = {"t": TIMES_S, "q": SHARE + np.arange(7), "arms": SHARE[:, None] + np.ones((2, 4))}
    matrix = 3.0 * rng.normal(size=shape) + SHARE[..., None] * rng.normal(size=shape)
    np.savez(tmp_path / "a.npz", **arrays, matrix=matrix)
    content, text, _ = suggested(tmp_path / "a.npz")
    entries = [*content["observed"], *content.get("controlled", [])]
    used = {column for one in entries for column in one["columns"]}
    assert {"q.6", "arms.1.3"} <= used and not [name for name in used if "matrix" in name]
    assert "They move, and are no positions: matrix.0.0" in text


def test_pickled_objects_beside_arrays_are_left_out(tmp_path):
    infos = np.array([{"reward": 1.0}] * ROWS)
    columns, time = [f"w.{k}" for k in range(3)], {"column": "t"}
    for arrays in ({"t": TIMES_S, "w": PLACE / 1000}, {}):
        np.savez(tmp_path / "a.npz", **arrays, infos=infos)
        samples, said = imported(tmp_path, "a.npz", None, columns, time=time)
        assert ("pickled objects, left out: infos" in said) == bool(arrays)
    assert samples is None and "plain arrays, got pickled objects infos" in said


WHERE = [f"w.{n}.{axis}" for n in range(2) for axis in range(3)]
SEEN = [np.ones(1 + k % 3) for k in range(1001)]
"""Cells of what was seen at each sample: no columns."""


@pytest.mark.parametrize(
    ("kind", "key"),
    [("npz", "fps"), ("npz", "mocap_framerate"), ("h5", "FPS"), ("5", "fs"), ("7.3", "fs")],
)
def test_a_number_that_is_called_a_rate_is_that_of_the_file(kind, key, tmp_path):
    path = tmp_path / f"a.{kind if kind in ('npz', 'h5') else 'mat'}"
    if kind == "npz":
        np.savez(path, w=PLACE / 1000, **{key: 50.0})
    elif kind == "h5":
        h5(path, {"w": PLACE / 1000}, **{key: 50, "note": "by me"})
    else:
        mat(path, {key: 50.0, "w": PLACE / 1000}, float(kind))
    found = imported(tmp_path, path.name, None, [f"w.{k}" for k in range(3)])
    check_wrist(found)
    assert set(np.diff(found[0].stamps_ns)) == {20_000_000}


def test_a_rate_may_be_stated_by_a_period_or_beside_the_arrays(tmp_path):
    np.savez(tmp_path / "a.npz", w=PLACE / 1000, dt=0.02, none=np.empty((ROWS, 0)))
    mat(tmp_path / "b.mat", {"take": {"fs": 50.0, "w": PLACE / 1000}}, 5)
    for name in ("a.npz", "b.mat"):
        assert open_table(tmp_path / name).defaults == {"time": {"rate": 50.0}}


def test_samples_along_another_axis_are_named_where_nothing_says_so(rng, tmp_path):
    np.savez(tmp_path / "a.npz", w=rng.normal(size=(3, ROWS)))
    _, said = imported(tmp_path, "a.npz", None, ["w.0", "w.1", "w.2"], time={"rate": 100})
    assert "w has 3 rows and 200 columns. Likely its columns are samples: transpose it." in said


@pytest.mark.parametrize("count", [2, 50])
@pytest.mark.parametrize("kind", ["npz", "h5"])
def test_demonstrations_along_the_first_axis_are_cut(kind, count, tmp_path):
    moved = PLACE / 1000 + 0.01 * np.arange(count)[:, None, None]
    labels = np.where(np.arange(count) % 2, "take", "give")
    arrays = {"t": TIMES_S, "w": moved, "q": moved[:, :, 0], "of": np.arange(count)}
    if kind == "npz":
        np.savez(tmp_path / "a.npz", task=labels, **arrays)
    else:
        h5(tmp_path / "a.h5", arrays | {"task": labels.astype("S")})
    (path,) = tmp_path.iterdir()
    found = demonstrations(path, ["w.0", "w.1", "w.2"], {"column": "task"}, rate=None)
    values = np.stack([one.samples[0].values for one in found])
    np.testing.assert_array_equal(values, moved)
    assert [one.custom_data["task"] for one in found] == labels.tolist()


@pytest.mark.parametrize("kind", ["h5", "mat"])
def test_times_beside_a_rate_are_asked_for_and_texts_are_labels(kind, tmp_path):
    labels = np.where(np.arange(ROWS) < 120, "give", "take").astype(object)
    arrays = {"t": TIMES_S, "w": PLACE / 1000, "label": labels}
    if kind == "h5":
        h5(tmp_path / "made.h5", arrays, fps=30.0)  # of the camera
    else:
        mat(tmp_path / "made.mat", arrays | {"fps": 30.0}, 5)
    path = tmp_path / f"made.{kind}"
    content = {"observed": [entry(["w.0", "w.1", "w.2"])], "task": {"column": "label"}}
    (left_out,) = import_demonstrations(path, ImportMap.from_dict(content))
    assert "expected times, or a rate, got neither" in left_out.reason
    content["time"] = {"column": "t"}
    found = import_demonstrations(path, ImportMap.from_dict(content))
    assert [(d.custom_data["task"], d.samples[0].stamps_ns.size) for d in found] == [
        ("give", 120),
        ("take", ROWS - 120),
    ]
    assert "time: {column: t, unit: s}" in suggest_map(path)


@pytest.mark.parametrize("times", [TIMES_S, TIMES_S[None], TIMES_S[:, None]])
@pytest.mark.parametrize("kind", ["npz", "h5", "demonstrations", "mat"])
def test_samples_along_the_second_axis_are_read_as_along_the_first(kind, times, tmp_path):
    arrays = {"t": times, "w": PLACE.T / 1000, "q": np.arange(7)[:, None] + TIMES_S, "few": [1, 2]}
    if kind == "npz":
        np.savez(tmp_path / "a.npz", **arrays)
    elif kind == "mat":
        pytest.importorskip("h5py")
        savemat(tmp_path / "a.mat", {"note": "by me", "s": {"b": {"c": [1.0]}}, **arrays})
    else:
        before = "data/demo_0/" if kind == "demonstrations" else ""
        h5(tmp_path / "a.h5", {before + name: array for name, array in arrays.items()})
    (path,) = tmp_path.iterdir()
    read = open_table(path)
    column = "t" if "t" in read.names else "t.0"
    found = read.columns([column, *(f"w.{k}" for k in range(3)), "q.6"])
    t, *w, q = found.values()
    np.testing.assert_array_equal([t, q], [TIMES_S, 6 + TIMES_S])
    np.testing.assert_array_equal(np.column_stack(w), PLACE / 1000)


def qualisys(count, bodies=()):
    """A take of QTM, whose places (n, 4, T) [mm] have residuals."""
    data = np.stack([np.column_stack([PLACE + 10.0 * k, SHARE]).T for k in range(count)])
    labels = np.array(["wrist", "elbow"][:count] or ["none"], object)
    markers = {"Labels": labels, "Data": data, "Type": np.ones((count, ROWS))}
    take = {"FrameRate": 50, "Frames": ROWS, "Trajectories": {"Labeled": markers}}
    if bodies:
        places = np.stack([PLACE.T for _ in bodies])
        turns = np.zeros((len(bodies), 9, ROWS))
        names = np.array(bodies, object)
        take["RigidBodies"] = {"Name": names, "Positions": places, "Rotations": turns}
    return take


@pytest.mark.parametrize(("count", "bodies"), [(1, ()), (2, ()), (2, ("hand",))])
def test_markers_and_bodies_of_qtm_in_matlab(count, bodies, tmp_path):
    pytest.importorskip("h5py")
    savemat(tmp_path / "a.mat", {"take01": qualisys(count, bodies)})
    read = open_table(tmp_path / "a.mat")
    assert (read.unit, read.defaults, read.notes) == ("mm", {"time": {"rate": 50.0}}, ())
    names = [*["wrist", "elbow"][:count], *bodies]
    assert read.names == tuple(f"{name}.{axis}" for name in names for axis in "xyz")
    for k, name in enumerate(names):
        found = np.column_stack([*read.columns([f"{name}.{axis}" for axis in "xyz"]).values()])
        np.testing.assert_array_equal(found, PLACE + (0.0 if name == "hand" else 10.0 * k))


def test_samples_along_the_last_of_three_axes_are_named(tmp_path):
    pytest.importorskip("h5py")
    take = qualisys(2)["Trajectories"]["Labeled"]
    savemat(tmp_path / "a.mat", {"p": {"Data": take["Data"], "t": TIMES_S}})
    (said,) = open_table(tmp_path / "a.mat").notes
    assert said.startswith(f"p.Data has the shape (2, 4, {ROWS}). Likely its last axis is samples")


ON_END = {
    "one array each": ("w", {f"w_{k}": PLACE[k:] / 1000 for k in range(3)}, 3),
    "two of one name": ("demo", {f"demo_{k}": PLACE / 1000 for k in range(2)}, 2),
    "inside": ("trial_w", {"t": TIMES_S} | {f"trial_{k}_w": PLACE / 1000 for k in range(2)}, 2),
    "several each": (
        "w",
        {f"t{k}": TIMES_S[k:] for k in range(3)} | {f"w{k}": PLACE[k:] / 1000 for k in range(3)},
        3,
    ),
    "another length, of two agents": ("w_0", {"w_0": PLACE / 1000, "w_1": PLACE[1:] / 1000}, 1),
    "markers": ("w1", {f"w{k}": PLACE / 1000 for k in range(5)}, 1),
    "as many as samples": ("demo", {f"demo_{k}": PLACE[:3] / 1000 for k in range(3)}, 3),
}  # fmt: skip
"""Name of the place, arrays, and how many demonstrations they are."""


@pytest.mark.parametrize("kind", ON_END)
def test_arrays_with_numbers_are_demonstrations_where_names_or_lengths_say_so(kind, tmp_path):
    name, arrays, count = ON_END[kind]
    np.savez(tmp_path / "a.npz", label=["give", "take", "give"][:count], **arrays)
    task = {"column": "label"} if count > 1 else "give"
    columns, rate = [f"{name}.{k}" for k in range(3)], 100 * ("t" not in arrays)
    found = demonstrations(tmp_path / "a.npz", columns, task, rate)
    assert [one.custom_data["task"] for one in found] == ["give", "take", "give"][:count]
    for k, one in enumerate(found):
        shorter = k if kind in ("one array each", "several each") else 0
        wanted = arrays["demo_0"] if "demo_0" in arrays else PLACE[shorter:] / 1000
        np.testing.assert_array_equal(one.samples[0].values, wanted)


def test_an_npy_has_columns_by_number(tmp_path):
    np.save(tmp_path / "a.npy", np.column_stack([TIMES_S, PLACE / 1000]))
    check_wrist(imported(tmp_path, "a.npy", None, [1, 2, 3], time={"column": 0}), atol=0.0)
    np.save(tmp_path / "a.npy", np.zeros((2, 3, 4, 5)))
    assert "(2, 3, 4, 5)" in imported(tmp_path, "a.npy", None, [1, 2, 3])[1]
    np.save(tmp_path / "a.npy", np.array([{}]), allow_pickle=True)
    assert "one array (T, d)" in imported(tmp_path, "a.npy", None, [1, 2, 3])[1]


def imported_npy(array, tmp_path):
    """Places of the demonstrations in an array that stands alone."""
    np.save(tmp_path / "a.npy", array)
    return [one.samples[0].values for one in demonstrations(tmp_path / "a.npy", range(3))]


@pytest.mark.parametrize("count", [2, 50])
def test_an_array_alone_holds_demonstrations_where_its_numbers_say_so(count, rng, tmp_path):
    goals = rng.normal(size=(count, 1, 3))
    moved = PLACE / 1000 + 0.1 * SHARE * goals + 0.001 * rng.normal(size=(count, ROWS, 3))
    np.testing.assert_array_equal(imported_npy(moved, tmp_path), moved)
    landmarks = np.moveaxis(moved, 0, 1)  # of one demonstration, (T, n, 3)
    (values,) = imported_npy(landmarks, tmp_path)
    np.testing.assert_array_equal(values, landmarks[:, 0])


@pytest.mark.parametrize("hidden", [0, 5])
def test_an_array_alone_is_turned_where_its_numbers_say_so(hidden, rng, tmp_path):
    moved = PLACE / 1000 + 0.001 * rng.normal(size=(ROWS, 3))
    moved[:hidden, 2] = np.nan
    for array in (moved, moved.T):
        (values,) = imported_npy(array, tmp_path)
        np.testing.assert_array_equal(values, moved)
    many = (PLACE[:, :1] + rng.normal(size=ROWS // 2)).T  # too many rows to be sure of
    np.save(tmp_path / "a.npy", many)
    assert "transpose it" in " ".join(open_table(tmp_path / "a.npy").notes)


def test_a_replay_buffer_is_cut_and_fields_of_records_are_columns(tmp_path):
    buffer = {"data/eef_pos": PLACE / 1000, "meta/episode_ends": [80, ROWS]}
    h5(tmp_path / "a.hdf5", buffer)
    records = np.array(list(map(tuple, PLACE / 1000)), [(axis, float) for axis in "xyz"])
    h5(tmp_path / "b.hdf5", {"w": records})
    for name, columns, lengths in (
        ("a", [f"data.eef_pos.{k}" for k in range(3)], [80, ROWS - 80]),
        ("b", ["w.x", "w.y", "w.z"], [ROWS]),
    ):
        found = demonstrations(tmp_path / f"{name}.hdf5", columns)
        parts = [one.samples[0].values for one in found]
        assert list(map(len, parts)) == lengths
        np.testing.assert_array_equal(np.concatenate(parts), PLACE / 1000)


def test_numbered_groups_of_hdf5_are_demonstrations(tmp_path):
    poses = {k: np.hstack([PLACE + k, np.tile([0, 0, 0, 1], (ROWS, 1))]) for k in range(3)}
    arrays = {f"traj_{k}/obs/tcp_pose": pose for k, pose in poses.items()}
    h5(tmp_path / "made.h5", arrays | {f"traj_{k}/actions": PLACE[1:] for k in poses})
    columns = [f"obs.tcp_pose.{k}" for k in range(3)]
    said, *found = demonstrations(tmp_path / "made.h5", columns, columns_unit="mm")
    assert "left out: actions" in said.reason and len(found) == 3
    for k, one in enumerate(found):
        np.testing.assert_allclose(one.samples[0].values, (PLACE + k) / 1000)


def test_demonstrations_below_groups_have_the_labels_of_their_attributes(tmp_path):
    with pytest.importorskip("h5py").File(tmp_path / "a.h5", "w") as file:
        for k, name in enumerate(("ann/trial_0", "ann/trial_1", "bob/trial_0")):
            group = file.create_group(name)
            group["time"], group["wrist/x"] = TIMES_S[:, None], PLACE[:, :1] / 1000 + k
            group["wrist/y"], group["wrist/z"] = PLACE[:, 1:2] / 1000, PLACE[:, 2:] / 1000
            group.attrs.update({"task": "give" if k else "take", "model": "x" * 999})
            group.attrs.update({"by": "ann", "demonstration": "of a task"})
    content, _, found = suggested(tmp_path / "a.h5")
    assert content["observed"][0]["columns"] == ["wrist.x", "wrist.y", "wrist.z"]
    table = open_table(tmp_path / "a.h5")
    assert table.find("wrist.x.0") == table.find("wrist.x") and "model" not in table.names
    assert table.names[0] == "demonstration"
    assert [one.name for one in found] == ["ann_trial_0", "ann_trial_1", "bob_trial_0"]
    assert [one.custom_data["task"] for one in found] == ["take", "give", "give"]
    for k, one in enumerate(found):
        check_wrist((one.samples[0], ""), PLACE / 1000 + [k, 0, 0], times_atol=1)


@pytest.mark.parametrize("shape", [(0,), (0, 1), (0, 7), (7, 0)])
def test_an_empty_array_beside_others_has_no_columns(shape, tmp_path):
    arrays = {"t": TIMES_S, "wrist": PLACE / 1000, "none": np.empty(shape)}
    h5(tmp_path / "a.h5", arrays)
    np.savez(tmp_path / "a.npz", **arrays)
    for name in ("a.h5", "a.npz"):
        _, _, found = suggested(tmp_path / name)
        check_wrist((found[-1].samples[0], ""), PLACE / 1000)


def test_a_number_that_stands_for_none_was_not_measured(tmp_path):
    lost = np.arange(ROWS) % 9 == 4
    with pytest.importorskip("h5py").File(tmp_path / "a.h5", "w") as file:
        file["t"], file["w"] = TIMES_S, np.where(lost[:, None], -9999.0, PLACE / 1000)
        file["w"].attrs.update({"_FillValue": np.float32(-9999.0), "missing_value": "none"})
    found = read(str(tmp_path / "a.h5"))
    np.testing.assert_array_equal(np.isnan(found["w"]), np.repeat(lost[:, None], 3, axis=1))
    np.testing.assert_array_equal(found["w"][~lost], PLACE[~lost] / 1000)
