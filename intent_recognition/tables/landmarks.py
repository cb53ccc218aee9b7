# SPDX-License-Identifier: Apache-2.0
"""Read landmarks of people from JSON: OpenPose's, MediaPipe's, and rows of named numbers."""

import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from intent_recognition.array_types import Integers
from intent_recognition.errors import one_line
from intent_recognition.signals import MIN_SAMPLES
from intent_recognition.tables.by_body import by_body, listed_names, of_records
from intent_recognition.tables.cells import OF_IMAGE, are_of_image, pixels_of, text_of
from intent_recognition.tables.hdf5_reading import RATES, UNIT
from intent_recognition.tables.skeletons import of_qualisys
from intent_recognition.tables.table import MOST_COLUMNS, MOST_TEXT, Table, table_of, unusable
from intent_recognition.tables.times import TIME_NAME, usual_unit
from intent_recognition.untrusted import UntrustedError, check_regular

FRAMES = "_keypoints.json"
"""Ending of OpenPose's file names."""


def _names(text: str) -> tuple[str, ...]:
    return tuple(text.split())


COCO_18 = _names(
    "Nose Neck RShoulder RElbow RWrist LShoulder LElbow LWrist RHip RKnee RAnkle LHip LKnee LAnkle"
    " REye LEye REar LEar"
)
FEET = _names("LBigToe LSmallToe LHeel RBigToe RSmallToe RHeel")
BODY_25 = (*COCO_18[:8], "MidHip", *COCO_18[8:], *FEET)
POSE_33 = _names(
    "nose left_eye_inner left_eye left_eye_outer right_eye_inner right_eye right_eye_outer left_ear"
    " right_ear mouth_left mouth_right left_shoulder right_shoulder left_elbow right_elbow"
    " left_wrist right_wrist left_pinky right_pinky left_index right_index left_thumb right_thumb"
    " left_hip right_hip left_knee right_knee left_ankle right_ankle left_heel right_heel"
    " left_foot_index right_foot_index"
)
HAND_21 = (
    "wrist",
    *(
        f"{finger}_{joint}"
        for finger in _names("thumb index middle ring pinky")
        for joint in _names("cmc mcp ip tip" if finger == "thumb" else "mcp pip dip tip")
    ),
)
COCO_17 = _names(
    "nose left_eye right_eye left_ear right_ear left_shoulder right_shoulder left_elbow right_elbow"
    " left_wrist right_wrist left_hip right_hip left_knee right_knee left_ankle right_ankle"
)
NAMED = {len(names): names for names in (BODY_25, COCO_17, COCO_18, POSE_33, HAND_21)}
"""Names of landmarks by their number."""
Groups = Mapping[str, tuple[str, int]]
OPENPOSE: Groups = {
    "pose_keypoints": ("", 2), "pose_keypoints_2d": ("", 2),
    "hand_left_keypoints_2d": ("LHand.", 2), "hand_right_keypoints_2d": ("RHand.", 2),
}  # fmt: skip
"""Groups of a person's landmarks in an image: prefix of the names, and number of dimensions."""
OPENPOSE_3D: Groups = {
    "pose_keypoints_3d": ("", 3),
    "hand_left_keypoints_3d": ("LHand.", 3), "hand_right_keypoints_3d": ("RHand.", 3),
}  # fmt: skip
"""Groups in space. If any exists, those in the image are not used: untriangulated ones are gaps."""
WORLD = _names(
    "world_landmarks pose_world_landmarks poseWorldLandmarks worldLandmarks hand_world_landmarks"
    " handWorldLandmarks multi_hand_world_landmarks"
)
IMAGE = _names(
    "landmarks pose_landmarks poseLandmarks keypoints hand_landmarks handLandmarks"
    " multi_hand_landmarks instances"
)
"""Keys of MediaPipe's landmarks in the image; `WORLD` has those in metres, which are preferred."""
ONE_PERSON = "Keep one person in the files."
NUMBERS = _names("image_id frame frame_id frame_number frame_index frame_idx")
"""Keys of the number of a frame, or of an image name that ends with it."""
SPARSE = 100
"""Largest range of frame numbers per frame; ids of a collection are farther apart."""
FEW_FRAMES = 0.1
"""Largest share of frames with several people, due to passers-by or reflections, that may be left
out."""
Points = dict[str, Sequence[float]]
Result = TypeVar("Result")


def open_frames(folder: Path) -> Table:
    """Read OpenPose's folder with a file for each frame: `RWrist.x`, `RWrist.y` [pixels], ...

    A landmark with confidence 0 was not seen. Missing frames are gaps, as are the few frames with
    several people, who cannot be identified.
    """
    files = sorted(folder.glob(f"*{FRAMES}"))
    contents = [(path, _load(path)) for path in files]
    return _of_openpose(folder, contents, _rows([path.name[: -len(FRAMES)] for path in files]))


def _rows(numbers: Sequence[object]) -> Integers:
    """Rows of frames, from 0 on, by the numbers at the end of their names, or else in order."""
    found = [re.search(r"(\d+)(?:\.\D\w*)?$", text_of(number)) for number in numbers]
    rows = [int(match[1]) for match in found if match]
    least = min(rows, default=0)
    if len(set(rows)) < len(numbers) or max(rows) - least >= SPARSE * len(rows):
        return np.arange(len(numbers))
    found_rows = np.array([row - least for row in rows])
    steps = np.bincount(np.diff(np.sort(found_rows)), minlength=2)
    return found_rows if steps.argmax() == 1 else np.arange(len(numbers))  # else stamps or ids


def _of_openpose(source: Path, contents: Sequence[tuple[Path, Any]], rows: Integers) -> Table:
    """Table of OpenPose's frames, each given with its file."""
    found: list[tuple[Path, list[Any]]] = []
    for path, content in contents:
        people = content.get("people") if isinstance(content, dict) else None
        if not isinstance(people, list):
            raise unusable(path, "one person of OpenPose", "none", ONE_PERSON)
        found.append((path, people))

    def in_3d(person: Mapping[str, Any]) -> bool:  # whether OpenPose triangulated any landmark
        return any(number > 0.0 for key in OPENPOSE_3D for number in person.get(key) or ())

    in_space = any(_read(path, in_3d, one) for path, people in found for one in people)
    read = partial(_openpose, OPENPOSE_3D if in_space else OPENPOSE)
    frames = [_read(path, read, people[0]) if len(people) == 1 else {} for path, people in found]
    several = sum(len(people) > 1 for _, people in found)
    if several > FEW_FRAMES * len(frames):
        got = f"several people in {several} of {len(frames)} frames"
        raise unusable(source, "one person of OpenPose", got, ONE_PERSON)
    notes = [f"left out, of several people: {several} of {len(frames)} frames"] if several else []
    if not in_space:
        notes.append(OF_IMAGE)
    return table_of(source, _columns(frames, rows), notes=notes)


def open_landmarks(path: Path) -> Table:
    """Read MediaPipe's frames, `right_wrist.x`, ..., preferably in metres, or other JSON tables."""
    content = _load(path)
    frames = content.get("frames", content.get("results")) if isinstance(content, dict) else content
    if frames is None and isinstance(content, dict):  # rows under another key
        lists = [v for v in content.values() if isinstance(v, list) and v]
        firsts = [v[0][0] if isinstance(v[0], list) and v[0] else v[0] for v in lists]
        of_rows = [v for v, first in zip(lists, firsts, strict=True) if isinstance(first, dict)]
        of_numbers = [v for v in lists if not isinstance(v[0], dict | str)]
        longer = [len(v) for v in of_numbers if of_rows and len(v) > len(of_rows[0])]
        are_columns = len(longer) > len(set(longer))  # beside a list of events
        frames = of_rows[0] if len(of_rows) == 1 and not are_columns else None
    keys = _numbered(content) if isinstance(content, dict) else []
    if keys:
        found = [(key, content[key]) for key in keys]
        frames = [{"index": k, **v} if isinstance(v, dict) else v for k, v in found]
    elif isinstance(content, dict) and "Timebase" in content:
        return _read(path, partial(of_qualisys, path), content)
    elif isinstance(content, dict):
        frames = _read(path, _of_pandas, content) or frames
    if isinstance(content, dict) and not isinstance(frames, list):
        return table_of(path, _read(path, _of_lists, content), **_about(path, content))
    if not isinstance(frames, list) or not frames:
        raise unusable(path, "a list of frames with landmarks", "none", "Check the file.")
    if trials := _read(path, _of_trials, frames):
        about = _about(path, content)
        about["defaults"] |= {"segments": {"column": "demonstration"}}
        return table_of(path, trials, **about)
    number = next((k for k in NUMBERS if all(isinstance(f, dict) and k in f for f in frames)), "")
    rows = _rows([frame[number] for frame in frames] if number else keys or range(len(frames)))
    listed = [frame.get("people") for frame in frames if isinstance(frame, dict)]
    are_all = None not in listed and len(listed) == len(frames)
    if are_all and any("keypoints" in str(people) for people in listed):
        return _of_openpose(path, [(path, frame) for frame in frames], rows)
    images = [f.get("image_id") for f in frames if isinstance(f, dict)]
    if len(set(map(str, images))) < len(images) and images.count(None) < len(images):
        raise unusable(path, "one person in each image", "several results of one", ONE_PERSON)
    key = next((k for k in (*WORLD, *IMAGE) if _has(frames, k)), "")
    people = [_read(path, partial(_people, key), frame) for frame in frames]
    about, bodies = _about(path, content), listed_names(content)
    if not any(people):
        columns = _read(path, partial(of_records, bodies=bodies), frames)
        return by_body(table_of(path, columns, **about))
    read = partial(_points, bodies=bodies)
    points = [_read(path, read, one[0]) if one else {} for one in people]
    notes = []
    if key in IMAGE or (not key and _is_of_image(points)):
        notes.append(OF_IMAGE)
    if several := sum(len(one) > 1 for one in people):
        notes.append(
            f"{several} frames have several people or hands, whose order may change: the first of"
            " each is read. Keep one in the file."
        )
    stamp = next((k for k in ("timestamp_ms", "timestamp", "time") if _has(frames, k)), None)
    columns = _columns(points, rows if stamp is None else np.arange(len(frames)))
    if stamp is not None:
        stamps = [frame.get(stamp) if isinstance(frame, dict) else None for frame in frames]
        columns["time"] = _read(path, lambda all: np.array(all, np.float64), stamps)
        unit = "ms" if stamp.endswith("_ms") else usual_unit(np.diff(columns["time"])) or "s"
        about["defaults"] = {"time": {"column": "time", "unit": unit}}
    return table_of(path, columns, **about, notes=notes)


def _is_of_image(frames: Sequence[Points]) -> bool:
    """Whether landmarks are MediaPipe's in the image; those in metres have both signs."""
    seen = [point for frame in frames for point in frame.values()]
    names = {frozenset(frame) for frame in frames if frame}
    are_known = names <= {frozenset(POSE_33), frozenset(HAND_21)}
    are_inside = are_known and all(min(point[:2]) >= 0.0 for point in seen)
    return are_inside or all(len(point) == 2 for point in seen)


def _about(path: Path, content: Any) -> dict[str, Any]:
    """The rate and unit given beside the frames, as attributes of the table."""
    said = {key.lower(): v for key, v in content.items()} if isinstance(content, dict) else {}
    unit = next((said[key] for key in UNIT if isinstance(said.get(key), str)), "")
    rate = next((said[key] for key in RATES if isinstance(said.get(key), int | float | str)), None)
    defaults = {} if rate is None else {"time": {"rate": _read(path, float, rate)}}
    return {"unit": unit, "defaults": defaults}


def _numbered(content: Mapping[str, Any]) -> list[str]:
    """Keys made of a common word and a number, such as `frame_12`, ordered by number."""
    found = {key: re.fullmatch(r"(\D*)(\d+)", key) for key in content}
    if not all(found.values()) or len({match[1] for match in found.values() if match}) != 1:
        return []
    first = next(iter(content.values()))
    is_long = isinstance(first, list) and len(first) > 4 * len(content)  # longer than frames
    if is_long and isinstance(first[0], int | float):
        return []  # columns
    return sorted(content, key=lambda key: int(found[key][2]))  # type: ignore[index]


def _of_pandas(content: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Rows, with their `index`, of a table in pandas' format `split`, `columns` or `index`."""
    if {"columns", "index", "data"} <= content.keys():
        names = [n if isinstance(n, str) else ".".join(map(str, n)) for n in content["columns"]]
        rows = (dict(zip(names, row, strict=True)) for row in content["data"])
        return [{"index": at, **row} for at, row in zip(content["index"], rows, strict=True)]
    inside = [list(one) if isinstance(one, dict) else [] for one in content.values()] or [[]]
    if not inside[0] or any(keys != inside[0] for keys in inside):
        return []
    if not (by_row := all(key[:1].isdigit() for key in content)):
        by_row = all(key[:1].isdigit() for key in inside[0])
        content = {at: {k: one[at] for k, one in content.items()} for at in inside[0]}
    return [{"index": at, **row} for at, row in content.items()] if by_row else []


def _of_lists(content: Mapping[str, Any]) -> dict[str, NDArray[Any]]:
    """Columns from named lists: numbers or texts (T,), or positions (..., d) as `NAME.x`, ..."""
    lists = dict(_lists(content))
    texts = {key for key, value in lists.items() if any(isinstance(one, str) for one in value)}
    own = {key for key in content.keys() & lists if len(lists[key]) >= MIN_SAMPLES} - texts
    most = max((len(lists[key]) for key in own or lists), default=0)
    bodies = listed_names(content)
    columns = {}
    for key in [key for key, value in lists.items() if len(value) == most]:
        array = np.array(lists[key], object if key in texts else np.float64)
        if array.size > MOST_COLUMNS * most:
            continue
        axes = "xyz" if array.ndim > 1 and array.shape[-1] in (2, 3) else ""
        are_named = bodies and array.ndim > 2 and array.shape[-2] == len(bodies)
        for index in np.ndindex(array.shape[1:]):
            last = [axes[k] if axes else str(k) for k in index[-1:]]
            place: tuple[Any, ...] = (slice(None), *index)
            path = [*map(str, index[:-1])]
            path[-1:] = [bodies[index[-2]]] if are_named else path[-1:]
            columns[".".join([key, *path, *last])] = array[place]
    if not any(column.dtype.kind == "f" for column in columns.values()):
        raise ValueError("no lists of numbers")
    return columns


def _of_trials(listed: Sequence[Any]) -> dict[str, NDArray[Any]]:
    """Columns of listed demonstrations with times, each an object of lists or a list of rows; empty
    if the list holds anything else.
    """
    parts: list[dict[str, NDArray[Any]]] = []
    for number, one in enumerate(listed):
        if isinstance(one, list) and one and all(isinstance(row, dict) for row in one):
            found = {name: column.tolist() for name, column in of_records(one).items()}
        else:
            found = dict(_lists(one)) if isinstance(one, dict) else {}
        clocks = [values for name, values in found.items() if TIME_NAME.search(name)]
        times = [len(clock) for clock in clocks if clock[:1] != clock[-1:]]  # not bodies of a frame
        if max(times, default=0) < max([MIN_SAMPLES, *map(len, found.values())]):
            return {}
        columns = _of_lists(found)
        size = len(next(iter(columns.values())))
        said = {**(one if isinstance(one, dict) else {}), "demonstration": number}
        texts = {n: np.full(size, v, object) for n, v in said.items() if isinstance(v, str | int)}
        parts.append(texts | columns)
    names = [name for name in parts[0] if all(name in part for part in parts)] if parts else []
    return {name: np.concatenate([part[name] for part in parts]) for name in names}


def _lists(content: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, list[Any]]]:
    """Lists in nested mappings, by their paths."""
    for key, value in content.items():
        if isinstance(value, dict):
            yield from _lists(value, f"{before}{key}.")
        elif isinstance(value, list) and value:
            yield before + key, value


def _read(path: Path, read: Callable[[Any], Result], content: Any) -> Result:
    """Apply a function to content of any form, raising BagError if it fails."""
    try:
        return read(content)
    except (TypeError, ValueError, OverflowError, AttributeError, KeyError) as error:
        raise unusable(path, "landmarks in JSON", one_line(error), "Write it again.") from error


def _has(frames: Sequence[Any], key: str) -> bool:
    return any(isinstance(frame, dict) and bool(frame.get(key)) for frame in frames)


def _columns(frames: Sequence[Points], rows: Integers) -> dict[str, NDArray[Any]]:
    """One column for each axis of each landmark, NaN in frames without the landmark."""
    count = int(rows.max(initial=-1)) + 1
    columns: dict[str, NDArray[Any]] = {"frame": np.arange(count)}
    for row, frame in zip(rows.tolist(), frames, strict=True):
        for name, point in frame.items():
            for axis, value in zip("xyz", point, strict=False):
                key = f"{name}.{axis}"
                if key not in columns:
                    columns[key] = np.full(count, np.nan)
                columns[key][row] = value
    return columns


def _openpose(groups: Groups, person: Mapping[str, Any]) -> Points:
    points: Points = {}
    for key, (before, size) in groups.items():
        values = np.array(person.get(key) or [], np.float64).reshape(-1, size + 1)
        names = NAMED.get(len(values), [str(k) for k in range(len(values))])
        for name, (*place, seen) in zip(names, values.tolist(), strict=True):
            if seen > 0.0:
                points[before + name] = place
    return points


def _people(key: str, frame: Any) -> list[Any]:
    """Landmarks of each person or hand in a frame of MediaPipe, under a key, however nested."""
    is_row = not isinstance(frame, dict)
    frame = frame if is_row else frame.get(key)
    is_flat = isinstance(frame, list) and frame and isinstance(frame[0], int | float)
    if is_flat and (not is_row or _are_triples(frame)):  # in COCO's format
        frame = pixels_of(np.array(frame, np.float64).reshape(-1, 3)).tolist()
    people = [frame]
    while people and not _is_person(people[0]):
        people = [inner for one in people for inner in _inside(one) if inner]
    return people


def _are_triples(row: Sequence[Any]) -> bool:
    """Whether numbers are x, y and confidence of each landmark in an image."""
    is_known = len(row) in [3 * count for count in NAMED] and all(map(np.isreal, row))
    return is_known and are_of_image(np.array(row, np.float64).reshape(-1, 3))


def _is_person(content: Any) -> bool:
    first = content[0] if isinstance(content, list) and content else None
    if isinstance(first, list):
        return bool(first) and isinstance(first[0], int | float)
    return isinstance(first, dict) and "x" in first


def _inside(content: Any) -> list[Any]:
    if isinstance(content, dict):
        keys = ("landmark", "landmarks", "keypoints")
        return [content[key] for key in keys if key in content]
    return content if isinstance(content, list) else []


def _points(listed: Sequence[Any], bodies: Sequence[str]) -> Points:
    known = NAMED.get(len(listed), [str(k) for k in range(len(listed))])
    names = bodies if len(bodies) == len(listed) else known
    found: Points = {}
    for name, point in zip(names, listed, strict=True):
        own = str(point.get("name") or name) if isinstance(point, dict) else name
        values = [point[a] for a in "xyz" if a in point] if isinstance(point, dict) else point
        found[own] = [float(value) for value in values]
    return found


def _load(path: Path) -> Any:
    try:
        check_regular(path, MOST_TEXT)
        content = path.read_bytes()
        try:
            return json.loads(content)
        except json.JSONDecodeError:  # one frame per line
            lines = content.splitlines()
            if len(lines) < 2 or not lines[0].rstrip().endswith(b"}"):
                raise
            return [json.loads(line) for line in lines if line.strip()]
    except (OSError, UntrustedError, ValueError, RecursionError) as error:
        raise unusable(path, "landmarks in JSON", one_line(error), "Write it again.") from error
