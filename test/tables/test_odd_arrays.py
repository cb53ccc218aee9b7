# SPDX-License-Identifier: Apache-2.0
"""Arrays and landmarks in any layout: read right, or what is odd is named."""

import json

import numpy as np
import pytest
from tables.odd_files import PLACE, ROWS, TIMES_S, imported

from intent_recognition.tables import import_demonstrations
from intent_recognition.tables.import_map import ImportMap

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


@pytest.mark.parametrize(
    ("array", "words"),
    [
        (PLACE.T, "w has 3 rows and 200 columns. Likely its columns are samples: transpose it."),
        (np.stack([PLACE] * 5), "w has the shape (5, 200, 3). Likely it has 5 demonstrations"),
    ],
)
def test_samples_along_another_axis_are_named(array, words, tmp_path):
    np.savez(tmp_path / "made.npz", w=array)
    content = (tmp_path / "made.npz").read_bytes()
    columns = [f"w{'.0' * (array.ndim - 2)}.{k}" for k in range(3)]
    assert words in imported(tmp_path, "a.npz", content, columns, time={"rate": 100})[1]


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
    "two hands": (
        json.dumps([f | {"worldLandmarks": f["worldLandmarks"] * 2} for f in frames()]),
        "200 frames have several people or hands",
    ),
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
