# SPDX-License-Identifier: Apache-2.0
"""Landmarks in any JSON: read right, or what is odd is named."""

import json

import numpy as np
import pytest
from tables.imports import check_wrist, imported, suggested
from tables.odd_files import PLACE, ROWS, TIMES_S, in_turns, of_bodies

from intent_recognition.tables.files import open_table


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
    name = "a.jsonl" if "line" in kind else "a.json"
    samples, said = imported(tmp_path, name, content, columns)
    assert said == (said if words else "") and words in said
    np.testing.assert_allclose(samples.values, PLACE / 1000)
    np.testing.assert_allclose(samples.stamps_ns - samples.stamps_ns[0], 1e9 * TIMES_S, atol=200)


@pytest.mark.parametrize("kind", ["rows", "lists"])
def test_unit_and_rate_beside_rows_of_json(kind, tmp_path):
    rows = [{"w": dict(zip("xyz", place, strict=True))} for place in (PLACE / 10).tolist()]
    inside = {"frames": rows} if kind == "rows" else {"w": (PLACE / 10).tolist()}
    content = json.dumps({"units": "cm", "fps": 50, **inside}).encode()
    found = imported(tmp_path, "a.json", content, ["w.x", "w.y", "w.z"])
    check_wrist(found)
    assert set(np.diff(found[0].stamps_ns)) == {20_000_000}


def test_people_in_frames_of_openpose(tmp_path):
    """Those of one file; a few frames with two people are left out, and many are refused."""
    person = [{"pose_keypoints": [100.0 + k, 200.0, 0.9] * 25} for k in range(ROWS)]
    frames = [{"people": [one] * (2 if k in (7, 8) else 1)} for k, one in enumerate(person)]
    columns, time = ["RWrist.x", "RWrist.y", "RWrist.y"], {"rate": 100}
    options = {"columns": columns, "unit": "mm", "time": time}
    samples, said = imported(tmp_path, "a.json", json.dumps(frames), **options)
    assert "left out, of several people: 2 of 200 frames" in said
    assert np.isnan(samples.values[7:9]).all()
    np.testing.assert_allclose(samples.values[9:, 0], 0.109 + np.arange(ROWS - 9) / 1000)
    frames = [{"people": [one] * 2} for one in person]
    samples, said = imported(tmp_path, "a.json", json.dumps(frames), **options)
    assert samples is None and "several people in 200 of 200 frames" in said


def test_what_openpose_does_not_see_in_space_is_a_gap_and_no_pixel(tmp_path):
    """The groups of the image are beside those in space, of which one may be missing."""
    frames = []
    for k, (x, y, z) in enumerate((PLACE / 1000).tolist()):
        in_space = [] if k == 3 else [x, y, z, 0.9 * (k != 5)] * 25
        image = [640.0, 360.0, 0.9] * 25
        frames.append({"people": [{"pose_keypoints_2d": image, "pose_keypoints_3d": in_space}]})
    columns = [f"RWrist.{axis}" for axis in "xyz"]
    samples, said = imported(tmp_path, "a.json", json.dumps(frames), columns, time={"rate": 100})
    assert not said
    seen = ~np.isin(np.arange(ROWS), (3, 5))
    np.testing.assert_array_equal(samples.values[seen], PLACE[seen] / 1000)
    assert np.isnan(samples.values[~seen]).all()


def test_landmarks_in_space_are_not_mixed_with_those_of_the_image(tmp_path):
    both = [f | {"landmarks": [[{"x": 0.5, "y": 0.5, "z": 0.0}] * 33]} for f in frames()]
    both[7]["worldLandmarks"] = []
    columns = [f"right_wrist.{axis}" for axis in "xyz"]
    samples, said = imported(tmp_path, "a.json", json.dumps(both), columns)
    assert not said and np.isnan(samples.values[7]).all()
    np.testing.assert_allclose(np.delete(samples.values, 7, 0), np.delete(PLACE, 7, 0) / 1000)


def test_keypoints_of_coco_are_of_one_person_in_each_image(tmp_path):
    results = [{"image_id": k, "keypoints": [1.0, 2.0, 0.9] * 17} for k in range(ROWS)]
    columns, time = ["right_wrist.x", "right_wrist.y", "right_wrist.y"], {"rate": 100}
    samples, _ = imported(tmp_path, "a.json", json.dumps(results), columns, time=time)
    assert samples.values.tolist() == [[1.0, 2.0, 2.0]] * ROWS
    samples, said = imported(tmp_path, "a.json", json.dumps(results * 2), columns, time=time)
    assert samples is None and "one person in each image" in said


def numbered(row):
    """What frames hold, the last first, and without those from 60 to 80."""
    return [row(k, (PLACE[k] / 1000).tolist()) for k in reversed(SEEN)]


SEEN = [k for k in range(ROWS) if not 60 <= k < 80]
NUMBERED = {
    "of COCO": numbered(lambda k, p: {"image_id": f"{k:04d}.jpg", "keypoints": [*p[:2], 0.9] * 17}),
    "of MediaPipe": numbered(lambda k, _: {"frame": 7 + k, "worldLandmarks": [landmarks(k)]}),
    "of OpenPose": {"fps": "100/1", "frames": numbered(
        lambda k, place: {"frame_id": k, "people": [{"pose_keypoints_3d": [*place, 0.9] * 25}]}
    )},
    "by their names": dict(numbered(lambda k, _: (f"frame_{k}", landmarks(k)))),
    "empty ones": [[] if 60 <= k < 80 else landmarks(k) for k in range(ROWS)],
}  # fmt: skip


@pytest.mark.parametrize("kind", NUMBERED)
def test_frames_that_are_left_out_take_their_time(kind, tmp_path):
    axes = "xy" if kind == "of COCO" else "xyz"
    wrist = "RWrist" if kind == "of OpenPose" else "right_wrist"
    columns = [f"{wrist}.{axes[k % len(axes)]}" for k in range(3)]
    options = {"time": {"rate": 100}}
    samples, said = imported(tmp_path, "a.json", json.dumps(NUMBERED[kind]), columns, **options)
    assert ("places in the image" in said) == (kind in ("of COCO", "by their names", "empty ones"))
    seen = np.isfinite(samples.values).all(axis=1)
    expected = PLACE[SEEN] / 1000
    np.testing.assert_allclose(samples.values[seen, : len(axes)], expected[:, : len(axes)])
    stamps = samples.stamps_ns[seen]
    np.testing.assert_array_equal(stamps - stamps[0], np.array(SEEN) * 10**7)


def test_landmarks_of_frames_with_times_are_no_demonstrations(tmp_path):
    frames = [[one | {"time": k / 100} for one in landmarks(k)] for k in range(ROWS)]
    (tmp_path / "a.json").write_text(json.dumps(frames))
    table = open_table(tmp_path / "a.json")
    assert "right_wrist.x" in table.names and "segments" not in table.defaults


@pytest.mark.parametrize(
    "ids",
    [
        [397133, 37777, 252219],
        [1700000000000 + 33 * k for k in range(3)],
        [f"{1700000000000 + 33 * k}.jpg" for k in range(3)],
    ],
)
def test_numbers_of_images_of_a_collection_and_stamps_are_no_rows(ids, tmp_path):
    results = [{"image_id": k, "keypoints": [1.0, 2.0, 0.9] * 17} for k in ids]
    (tmp_path / "a.json").write_text(json.dumps(results))
    assert open_table(tmp_path / "a.json").columns(["nose.x"])["nose.x"].tolist() == [1.0] * 3


PLACES = (PLACE / 1000).tolist()
AT = TIMES_S.tolist()
ROWS_OF = [dict(zip("xyz", place, strict=True)) for place in PLACES]
BY_AXIS = {axis: [row[axis] for row in ROWS_OF] for axis in "xyz"}
FLIPPED = [place[::-1] for place in PLACES]
COLUMNS = {"t": AT, **BY_AXIS, "what": ["give"] * ROWS}
CUP = dict.fromkeys("xyz", 0.1)


def timed(key, values):
    return [{"t": at, key: value} for at, value in zip(AT, values, strict=True)]


OF_WRIST = {
    "lists with texts": (COLUMNS, [*"xyz"]),
    "rows with lists": (
        [
            {"t": at, **row, "q": [0.0] * 7, "times": [1, 2, 3, 4]}
            for at, row in zip(AT, ROWS_OF, strict=True)
        ],
        [*"xyz"],
    ),
    "lists beside events": ({**COLUMNS, "events": [{"t": 0.5, "what": "grasp"}]}, [*"xyz"]),
    "lists beside settings": ({**COLUMNS, "set": {"lut": [0] * 999, "of": [{"a": 1}]}}, [*"xyz"]),
    "in a mapping": ({"made": {"a": 1}, "data": COLUMNS}, ["data.x", "data.y", "data.z", "data.t"]),
    "as pandas numbers them": ({k: dict(enumerate(v)) for k, v in COLUMNS.items()}, [*"xyz"]),
    "split by pandas": ({"columns": [*"zyx"], "index": AT, "data": FLIPPED}, [*"xyz", "index"]),
    "columns of pandas": (
        {axis: dict(zip(AT, values, strict=True)) for axis, values in BY_AXIS.items()},
        [*"xyz", "index"],
    ),
    "rows of pandas": (dict(zip(AT, ROWS_OF, strict=True)), [*"xyz", "index"]),
    "rows without names": (np.column_stack([TIMES_S, PLACE / 1000]).tolist(), [*"1230"]),
    "lists with numbers in their names": (
        {"t0": AT, **{f"q{k}": BY_AXIS[axis] for k, axis in enumerate("xyz")}},
        ["q0", "q1", "q2", "t0"],
    ),
    "places": ({"t": AT, "p": [[[0.0] * 3, p] for p in PLACES]}, ["p.1.x", "p.1.y", "p.1.z"]),
    "rows beside texts": ({"by": ["a"] * 300, "rows": timed("w", ROWS_OF)}, ["w.x", "w.y", "w.z"]),
    "by id": (timed("people", of_bodies("id", 1, 2)), [f"people.2.at.{k}" for k in range(3)]),
    **{
        f"rows of each {key}": (
            [
                {"t": AT[k], key: body, **(row if body == "wrist" else CUP)}
                for k, row in enumerate(ROWS_OF)
                for body in in_turns(k, "cup", "wrist")
            ],
            ["wrist.x", "wrist.y", "wrist.z"],
        )
        for key in ("body", "topic")
    },
    **{
        f"bodies by {key}": (
            timed("in", of_bodies(key, "cup", "wrist")),
            [f"in.wrist.at.{k}" for k in range(3)],
        )
        for key in ("name", "jointType")
    },
}
"""Content of a file, and its columns, perhaps with that of the time."""


@pytest.mark.parametrize("kind", OF_WRIST)
def test_json_of_a_wrist_however_it_is_written(kind, tmp_path):
    content, columns = OF_WRIST[kind]
    options = {"time": {"column": [*columns, "t"][3]}}
    if "what" in content:
        options["task"] = {"column": "what"}
    found = imported(tmp_path, "a.json", json.dumps(content), columns[:3], **options)
    check_wrist(found, atol=0.0, times_atol=1)


LISTS = {"label": "reach", "demonstration": "good", "time": AT, "wrist": PLACES}


@pytest.mark.parametrize(
    "content",
    [
        [LISTS, LISTS], {"trials": [LISTS, LISTS]}, {"trial_1": LISTS, "trial_2": LISTS},
        {"demos": [timed("wrist", ROWS_OF)] * 2},
    ],
)  # fmt: skip
def test_demonstrations_in_json_are_cut(content, tmp_path):
    (tmp_path / "a.json").write_text(json.dumps(content))
    _, text, found = suggested(tmp_path / "a.json")
    assert len(found) == 2 and "segments: {column: demonstration}" in text
    for one in found:
        check_wrist((one.samples[0], ""), times_atol=1)


def test_few_numbered_frames_of_many_numbers_are_no_columns(tmp_path):
    values = np.random.default_rng(0).normal(size=(60, 99))
    content = {str(k): row for k, row in enumerate(values.tolist())}
    (tmp_path / "a.json").write_text(json.dumps(content))
    found = open_table(tmp_path / "a.json").columns(["0", "98"])
    np.testing.assert_array_equal(np.transpose([found["0"], found["98"]]), values[:, [0, 98]])


IN_IMAGE = {
    "numbers alone": lambda points: [n for point in points for n in (*point, 0.9)],
    "of MMPose": lambda points: {"frame_id": 1, "instances": [{"keypoints": points, "bbox": [1]}]},
}


@pytest.mark.parametrize("kind", IN_IMAGE)
def test_landmarks_of_an_image_however_they_are_listed(kind, tmp_path):
    pixels = [[[5.0, 5.0]] * 10 + [place[:2]] + [[5.0, 5.0]] * 6 for place in PLACE.tolist()]
    content = [IN_IMAGE[kind](points) for points in pixels]
    columns = ["right_wrist.x", "right_wrist.y", "right_wrist.y"]
    options = {"time": {"rate": 100}, "unit": "mm"}
    samples, said = imported(tmp_path, "a.json", json.dumps(content), columns, **options)
    assert said == "the landmarks are places in the image, not in metres"
    np.testing.assert_allclose(samples.values[:, :2], PLACE[:, :2] / 1000)


BODIES = ["PELVIS", *(f"JOINT_{k}" for k in range(15)), "WRIST_RIGHT"]  # as many as of COCO
OF_BODIES = {
    "of Azure Kinect": lambda places, times: {
        "frames": [
            {"timestamp_usec": 1e6 * t, "bodies": [{"body_id": 1, "joint_positions": rows}]}
            for t, rows in zip(times, places.tolist(), strict=True)
        ]
    },
    "as keypoints": lambda places, times: {
        "frames": [
            {"timestamp": t, "keypoints": rows}
            for t, rows in zip(times, places.tolist(), strict=True)
        ]
    },
    "as lists": lambda places, times: {"time": times, "positions": places.tolist()},
}


@pytest.mark.parametrize("kind", OF_BODIES)
def test_bodies_have_the_names_that_the_file_lists(kind, tmp_path):
    places = np.arange(17.0)[:, None] + PLACE[:, None]
    content = {"joint_names": BODIES, **OF_BODIES[kind](places, TIMES_S.tolist())}
    (tmp_path / "a.json").write_text(json.dumps(content))
    table = open_table(tmp_path / "a.json")
    for k, body in enumerate(BODIES):
        found = [n for n, name in enumerate(table.names) if body in name.split(".")]
        assert [table.names[n].rpartition(".")[2] for n in found] == [*"xyz"]
        np.testing.assert_array_equal(np.transpose(table.read(found)), places[:, k])


@pytest.mark.parametrize(
    "content",
    [
        "null", "3", "[[]]", '[{"people": 3}]', '{"fps": "a", "frames": [[[0, 0]]]}',
        json.dumps([landmarks(0, "abc")]),
    ],
)  # fmt: skip
def test_json_of_something_else_is_refused(content, tmp_path):
    assert imported(tmp_path, "a.json", content, time={"rate": 100})[0] is None
