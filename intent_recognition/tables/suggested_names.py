# SPDX-License-Identifier: Apache-2.0
"""What the names of columns say of them, by which a map is suggested."""

import re
from collections import Counter
from collections.abc import Collection, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from intent_recognition.array_types import Floats
from intent_recognition.signals import FIRST_CLOCK_S, spelled
from intent_recognition.tables.cells import LENGTHS
from intent_recognition.tables.suggested_entries import SeenColumn
from intent_recognition.tables.times import TIME_NAME

COUNT_NAME = re.compile(r"(?i)(frame|index|idx|row|sample|counter)#?$")
COMMANDED = re.compile(r"(?i)(?:^|[./])actions?(?:[./]|$)")
"""What columns are called that were commanded, not measured."""
NO_JOINT = re.compile(
    r"(?i)stamp|time|elapsed|(?:^|[\W_])id$|\bobject|accel|(?:^|[\W_])(?:acc|mag)|gyr|secs?\b"
    r"|header|vel|effort|torque|current|temp|force|quality|error|gripper|\bjaw"
    r"|likelihood|confidence|visib|score|residual|\bRot\[|quat|orient|cube_pos|^states\.\d"
    r"|(?:^|[\W_])(?:cos|sin)(?:[\W_]|$)|wrench|gravity|rgb|colou?r|voltage|pressure|reward"
    rf"|[XYZ]position$|compress|{COMMANDED.pattern.removeprefix('(?i)')}"
)
"""What columns are called that move and are no position of a joint of an arm."""
SEGMENT_NAME = re.compile(
    r"(?i)(?:.*[\W_])?(?:trial|episode|demo(?:nstration)?|repetition|segment)"
    r"(?:[\W_]?(?:id|index|idx|number|nr|no))?"
)
"""What columns are called that count demonstrations."""
TASK_NAME = re.compile(
    r"(?i)(?:.*[\W_])?(?:task|label|class|gesture|activity|skill)(?:[\W_]?name)?"
)
"""What columns are called that say the task."""
NO_TASK = re.compile(r"(?i)frame_?id|(?:^|[\W_])(?:date|time)")
"""What columns of texts are called that say no task."""
LANDMARK = re.compile(r"(?P<body>(?:.+\.)?\d+)\.(?P<element>\d)")
"""Elements of arrays (T, n, d): of places, if d is 3, or 2, or 4 and the last says how sure."""
ELEMENTS = re.compile(
    r"(?i)^(?P<body>.*(pos|position|xyz|translation|pose|wrist|hand|eef|tcp|marker)s?)"
    r"(?:[\s_]*[\[(]?[cdm]?m[\])]?)?"
    r"[._\[](?P<element>\d)\]?$"
)
ARRAY = re.compile(r"(?P<body>.*[^\W\d_].*?)(?:\.|\[)(?P<element>\d)\]?")
"""Elements of any array, which is a place if it has three, unless its name says something else."""
NO_PLACE_IN_ARRAY = re.compile(
    r"(?i)joint|action|angle|(?:^|[\W_])d{0,2}q$"
    r"|(?:^|[\W_])(?:qpos|arm|robot|state|theta|phi|rpy|ctrl|config|finger|leg)s?[\W_\d]*$"
)
POSE_NAME = re.compile(r"(?i)pose|cartesian")
POSE_SIZES = (3, 6, 7)
"""Elements of a place: x, y, z, and a rotation vector or a quaternion."""
UNIT_END = re.compile(
    r"(?i)\s*(?:[\[(](?P<unit>[^\[\]()]*)[\])]"
    r"|(?<=[xyz])[_ ./-](?:[mcd]?m|(?:milli|centi|deci)?met(?:er|re)s?|inch(?:es)?))$"
)
"""A unit at the end of a name."""
PLACES = re.compile(r"^(?P<body>.*?)(?P<between>[._ ]?)(?P<axis>[wxyzWXYZ])$")
AXIS_FIRST = re.compile(r"(?P<axis>[xyzXYZ])[._ ]?(?P<body>\d+|[A-Z].*|(?<=[._ ])\D.*)")
"""Names such as `x1`, `xWrist` and `x_wrist`."""
NO_PLACE = re.compile(
    r"(?i)rotation|orientation|velocity|accel|gyr|euler|quat|(?:^|[\W_])(?:acc|mag)"
    r"|(?:rot|vel|dot|std|omega|ang|angle|force|moment|power|torque)s?[\W_]?$"
)
OTHERS = (NO_JOINT, NO_PLACE, NO_PLACE_IN_ARRAY)
NO_PLACE_BEFORE_AXIS = re.compile(r"(?i)(?:^|[\W_])[ravwfmg]$")
"""Letters right before an axis that speak of an angle, a velocity, a force, ..., as in `rx`."""


def bodies_of(columns: Mapping[str, SeenColumn]) -> dict[str, list[str]]:
    """Columns x, y, z of each body, or x, y of one in an image."""
    found: dict[str, dict[str, str]] = {}
    for name in columns:
        if COMMANDED.search(name):
            continue
        match = ELEMENTS.match(name) or LANDMARK.fullmatch(name) or ARRAY.fullmatch(name)
        is_other = match and match.re is ARRAY and any(no.search(match["body"]) for no in OTHERS)
        if match and not is_other:
            found.setdefault(match["body"], {})[match["element"]] = name
        end = UNIT_END.search(name)
        if end and end["unit"] and spelled(end["unit"]) not in LENGTHS:
            continue
        bare = UNIT_END.sub("", name)
        last = PLACES.match(bare)
        if last and not last["between"] and NO_PLACE_BEFORE_AXIS.search(last["body"]):
            continue
        for match in filter(None, (last, AXIS_FIRST.fullmatch(bare))):
            if not NO_PLACE.search(match["body"]):
                found.setdefault(match["body"], {})[match["axis"].lower()] = name
    matrices = _of_matrices(columns)
    bodies = {body: names[:3, 3].tolist() for body, names in matrices.items()}
    parts = {name for names in matrices.values() for name in names.flat}
    arrays: dict[str, set[int]] = {}  # sizes of the last axes
    for body, axes in found.items():
        arrays.setdefault(body.rpartition(".")[0], set()).add(len(axes))
    for body, axes in found.items():
        sizes = POSE_SIZES if POSE_NAME.search(body) else POSE_SIZES[:1]
        are_elements = set(axes) == set(map(str, range(len(axes))))
        is_pose = are_elements and len(axes) in sizes
        if are_elements and len(arrays[body.rpartition(".")[0]]) == 1 and LANDMARK.match(axes["0"]):
            is_pose |= len(axes) == 2
            is_pose |= len(axes) == 4 and _are_seen(*(columns[axes[k]] for k in sorted(axes)))
        in_image = set(axes) == set("xy") and body.rstrip("._ ")
        # with w it is a quaternion
        if (set(axes) == set("xyz") or is_pose or in_image) and not parts & {*axes.values()}:
            bodies[body] = [axes[a] for a in sorted(axes)][:3]
    return bodies


def _are_seen(*columns: SeenColumn) -> bool:
    """Whether the last of four columns may say how sure the place in the others is."""
    values = np.column_stack([column.values for column in columns])
    values = values[np.isfinite(values).all(axis=1)]
    is_quaternion = np.all(np.abs(np.linalg.norm(values, axis=1) - 1.0) < 0.01)
    return bool(np.all((values[:, 3] >= 0.0) & (values[:, 3] <= 1.0)) and not is_quaternion)


def _of_matrices(columns: Mapping[str, SeenColumn]) -> dict[str, NDArray[np.str_]]:
    """Columns (4, 4) of matrices of poses: of arrays (T, 4, 4), or (T, 16), also transposed ones,
    as libfranka has them.
    """
    found: dict[str, NDArray[np.str_]] = {}
    for name in columns:
        for last in (".3.3", "15", "15]"):
            kind = [f".{k // 4}.{k % 4}" if "." in last else last.replace("15", str(k))
                    for k in range(16)]  # fmt: skip
            names = np.array([name.removesuffix(last) + end for end in kind]).reshape(4, 4)
            if name.endswith(last) and set(names.flat) <= set(columns):
                sizes = np.reshape([columns[one].farthest for one in names.flat], (4, 4))
                body = name.removesuffix(last).rstrip("._[")
                for matrix, of in ((names, sizes), (names.T, sizes.T)):
                    if of[3].tolist() == [0.0, 0.0, 0.0, 1.0]:
                        found.setdefault(body, matrix)
    return found


def orientations_of(columns: Mapping[str, SeenColumn], bodies: Collection[str]) -> set[str]:
    """Columns of an orientation: those of an array behind its place, quaternions, matrices."""
    found = {name: ELEMENTS.match(name) or LANDMARK.fullmatch(name) for name in columns}
    matches = {name: match for name, match in found.items() if match}
    rest = {n for n, match in matches.items() if match["body"] in bodies and match["element"] > "2"}
    axes = {name: match for name in columns if (match := PLACES.match(UNIT_END.sub("", name)))}
    of = Counter(match["body"] for match in axes.values())
    turning = {m["body"] for m in axes.values() if m["axis"] in "wW" and of[m["body"]] == 4}
    rest |= {name for names in _of_matrices(columns).values() for name in names.flat}
    return rest | {name for name, match in axes.items() if match["body"] in turning}


def is_marker_of(body: str, bodies: Sequence[str]) -> bool:
    """Whether a body is a marker `BODY:MARKER` of another one."""
    owner, colon, _ = body.partition(":")
    return bool(colon) and any(other.split(".")[0] == owner for other in bodies)


def array_of(name: str) -> str:
    """The array that a column is an element of, `q` for `q.0`, `q_0` and `q[0]`; "" for none."""
    match = re.fullmatch(r"(.*?)[._\[]\d+\]?", name)
    return match[1] if match else ""


def is_joint(name: str) -> bool:
    """Whether a column that moves may be the position of a joint, by its name."""
    axis = PLACES.match(UNIT_END.sub("", name))
    before = axis["body"] if axis and not axis["between"] else ""
    is_rate = before[-1:].lower() != "r" and NO_PLACE_BEFORE_AXIS.search(before) is not None
    return not (NO_JOINT.search(name) or TIME_NAME.search(name) or is_rate)


def counts_rows(column: SeenColumn) -> bool:
    """Whether a column counts rows, as frames and indices do."""
    first, steps = column.values[0], np.diff(column.values)
    is_count = are_counts(column, steps) and 0.0 <= first <= steps[0] and first % 1.0 == 0.0
    return is_count or bool(COUNT_NAME.search(column.name))


def are_counts(column: SeenColumn, steps: Floats) -> bool:
    """Whether steps are a count's, not a clock's: one whole number, as of every second row."""
    is_even = steps.size and column.values[0] < FIRST_CLOCK_S and np.ptp(steps) == 0.0
    return bool(is_even and steps[0] >= 1.0 and steps[0] % 1.0 == 0.0)
