# SPDX-License-Identifier: Apache-2.0
"""What the names of columns say of them, by which a map is suggested."""

import re
from collections import Counter
from collections.abc import Collection, Mapping, Sequence

import numpy as np

from intent_recognition.signals import spelled
from intent_recognition.tables.cells import LENGTHS
from intent_recognition.tables.suggested_entries import SeenColumn
from intent_recognition.tables.times import TIME_NAME

COUNT_NAME = re.compile(r"(?i)(frame|index|idx|row|sample|counter)#?$")
COMMANDED = re.compile(r"(?i)(?:^|[./])actions?(?:[./]|$)")
"""What columns are called that were commanded, not measured."""
NO_JOINT = re.compile(
    r"(?i)stamp|time|elapsed|\bobject|accel|(?:^|[\W_])(?:acc|mag)|gyr|secs?\b"
    r"|header|vel|effort|torque|current|temp|force|quality|error|gripper|\bjaw"
    r"|likelihood|confidence|residual|\bRot\[|wrench|gravity|rgb|colou?r|voltage|pressure|reward"
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
"""Elements of arrays (T, n, d): of places, if d is 3."""
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
    bodies = _of_matrices(columns)
    for body, axes in found.items():
        sizes = POSE_SIZES if POSE_NAME.search(body) else POSE_SIZES[:1]
        is_pose = len(axes) in sizes and set(axes) == set(map(str, range(len(axes))))
        in_image = set(axes) == set("xy") and body.rstrip("._ ")
        if set(axes) == set("xyz") or is_pose or in_image:  # with w it is a quaternion
            bodies[body] = [axes[a] for a in sorted(axes)][:3]
    return bodies


def _of_matrices(columns: Mapping[str, SeenColumn]) -> dict[str, list[str]]:
    """Last columns of matrices of poses, arrays (T, 4, 4): `BODY.0.3`, `BODY.1.3`, `BODY.2.3`."""
    found = {}
    for name in columns:
        body = name.removesuffix(".3.3")
        places = [f"{body}.{row}.3" for row in range(3)]
        if body != name and set(places) <= set(columns):
            found[body] = places
    return found


def orientations_of(columns: Mapping[str, SeenColumn], bodies: Collection[str]) -> set[str]:
    """Columns of an orientation: those of an array behind its place, quaternions, matrices."""
    matches = {name: match for name in columns if (match := ELEMENTS.match(name))}
    rest = {n for n, match in matches.items() if match["body"] in bodies and match["element"] > "2"}
    axes = {name: match for name in columns if (match := PLACES.match(UNIT_END.sub("", name)))}
    of = Counter(match["body"] for match in axes.values())
    turning = {m["body"] for m in axes.values() if m["axis"] in "wW" and of[m["body"]] == 4}
    matrices = tuple(f"{body}." for body in _of_matrices(columns))
    rest |= {name for name in columns if matrices and name.startswith(matrices)}
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
    by_one = bool(np.all(np.diff(column.values) == 1.0)) and column.values[0] in (0.0, 1.0)
    return by_one or bool(COUNT_NAME.search(column.name))
