# SPDX-License-Identifier: Apache-2.0
"""Recognises columns by their names, to suggest a map."""

import re
from collections import Counter
from collections.abc import Collection, Mapping, Sequence

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.signals import FIRST_CLOCK_S, spelled
from intent_recognition.tables.cells import ANGLES, LENGTHS
from intent_recognition.tables.suggested_entries import ANGLE_END, SeenColumn
from intent_recognition.tables.times import TIME_NAME

COUNT_NAME = re.compile(r"(?i)(frame|index|idx|row|sample|count(?:er)?|number)#?$")
COMMANDED = re.compile(r"(?i)(?:^|[./_])actions?(?:[._/]|$)")
"""Names of columns that were commanded, not measured."""
COMMANDS = {"target", "desired", "des", "commanded", "command", "cmd", "setpoint", "planned", "ref",
            "d", "next", "w", "ipo"}  # fmt: skip
MEASURED = {"actual", "measured", "msr", "state", "obs", "observation", "observations", "q"}
"""Words by which names of commanded, or later, columns differ from those of measured ones."""
WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+")
NO_JOINT = re.compile(
    r"(?i)stamp|time|elapsed|(?:^|[\W_])id$|\bobject|accel|(?:^|[\W_])(?:acc|mag|cop)|gyr|secs?\b"
    r"|header|vel|speed|dot[\W_\d]*$|(?:^|[\W_])(?:d+q|qd+|tau|ctrl|control)(?:[\W_\d]|$)"
    r"|eff(?:ort|_)|torque|moment|trq|f_ext|current|temp|force|quality|error|gripper|\bjaw|rate$"
    r"|compass|likelihood|conf(?!ig)|strength|visib|score|covariance|twist(?!$|_joint)|residual"
    r"|\bRot\[|quat|orient|(?:^|[\W_])ori(?:[\W_]|$)|axis_?angle|cube_pos|^states\.\d"
    r"|(?:^|[\W_])(?:env(?:ironment)?|low_dim|ee)_states?(?:[\W_]|$)|robot_states\.\d|^lengths?$"
    r"|^(?:poses|pose_\w+|body_pose)\.\d"
    r"|(?:^|[\W_])(?:cos|sin)(?:[\W_]|$)|wrench|gravity|rgb|colou?r|voltage|pressure|reward|bits"
    r"|jerk|(?-i:[a-z]Acc)|(?:^|[\W_])(?:std|scale|dir(?:ection)?|normal)s?(?:[\W_]|$)"
    rf"|register|scaling|[XYZ]position$|compress|{COMMANDED.pattern.removeprefix('(?i)')}"
)
"""Names of columns that move without being the position of an arm's joint."""
SEGMENT_NAME = re.compile(
    r"(?i)(?:.*[\W_])?(?:trial|episode|demo(?:nstration)?|repetition|segment)"
    r"(?:[\W_]?(?:id|index|idx|number|nr|no))?"
)
"""Names of columns that number the demonstrations."""
TASK_NAME = re.compile(
    r"(?i)(?:.*[\W_])?(?:task|label|class|gesture|activity|skill)(?:[\W_]?name)?"
)
"""Names of columns that hold the task."""
NO_TASK = re.compile(r"(?i)frame_?id|(?:^|[\W_])(?:date|time)")
"""Names of columns of texts that hold no task."""
LANDMARK = re.compile(r"(?P<body>(?:.+\.)?\d+)\.(?P<element>\d)")
"""Elements of arrays (T, n, d): positions if d is 2 or 3, or 4 with a confidence at the end."""
ELEMENTS = re.compile(
    r"(?i)^(?P<body>.*(pos|position|xyz|translation|pose|wrist|hand|eef|tcp|marker)s?)"
    r"(?:[\s_]*[\[(]?[cdm]?m[\])]?)?"
    r"[._\[](?P<element>\d)\]?$"
)
ARRAY = re.compile(r"(?P<body>.*[^\W\d_].*?)(?:\.|\[)(?P<element>\d)\]?")
"""Elements of any array; three are a position unless the name says something else."""
NO_PLACE_IN_ARRAY = re.compile(
    r"(?i)joint|action|angle|(?:^|[\W_])d{0,2}q$"
    r"|(?:^|[\W_])(?:qpos|arm|robot|state|theta|phi|rpy|ctrl|config|finger|leg)s?[\W_\d]*$"
)
POSE_NAME = re.compile(r"(?i)pose|cartesian")
POSE_SIZES = (3, 6, 7)
"""Numbers of elements of a pose: x, y, z alone, with a rotation vector or with a quaternion."""
UNIT_END = re.compile(
    r"(?i)\s*(?:[\[(](?P<unit>[^\[\]()]*)[\])]"
    r"|(?<=[xyz])[_ .,/-](?:[mcd]?m|(?:milli|centi|deci)?met(?:er|re)s?|inch(?:es)?|ft|feet))$"
)
"""A unit at the end of a name."""
PLACES = re.compile(r"^(?P<body>.*?)(?P<between>[._ ]?)(?P<axis>[wxyzWXYZ])$")
AXIS_FIRST = re.compile(
    r"(?:[pP](?:os)?_?|t)?(?P<axis>[wxyzWXYZ])[._ ]?(?P<body>\d+|[A-Z].*|(?<=[._ ])\D.*)"
)
"""Names such as `x1`, `Px1`, `xWrist`, `x_wrist` and `tx_wrist`."""
NO_PLACE = re.compile(
    r"(?i)rotation|orientation|twist|velocity|accel|gyr|euler|quat|(?:^|[\W_])(?:acc|mag)"
    r"|(?-i:[a-z]Acc)|(?:rot|vel|dot|std|omega|ang|angle|theta|force|moment|power|torque|cop|speed"
    r"|jerk|scale|dir|direction|normal)s?[\W_]?$"
)
TURN = re.compile(
    r"(?i)(?P<body>.*?)[\W_]*(?:(?:[xyz]?rot(?:ation)?|orientation|euler|theta|rpy|axis_?angle)"
    r"(?:[\W_]*(?:angle|vec(?:tor)?)s?)?[\W_]*(?:[wxyz\d]\]?)?|[orq][wxyz]"
    r"|(?:rot)?(?:roll|pitch|yaw)|(?-i:[ABCWPR])|az(?:imuth)?|el(?:evation)?|ro)"
)
"""Names of angles of a body, beside those of its position."""
PLACE_WORD = re.compile(
    r"(?:(?:^|[\W_]+)(?i:pos(?:ition)?|loc(?:ation)?|pose|trans(?:lation)?|xyz|t|p)"
    r"|(?<=[a-z])Pos(?:ition)?)?[\W_]*$"
)
"""Ends of names of a position, after the name of the body."""
OTHERS = (NO_JOINT, NO_PLACE, NO_PLACE_IN_ARRAY)
NUMBERED = re.compile(r"(?P<body>.*?)[._\[( ]*(?P<at>\d+(?:[._,\]\[]+\d+)?)[\])]?")
"""Elements of any array: `q1`, `q.1`, `q[1]`, `m12`, `m_1_2`, `m[1][2]`, or bare numbers."""
OF_MATRIX = [
    ((rows, width), kind)
    for rows, width in ((4, 4), (3, 4), (3, 3))
    for k in (0, 1)
    for kind in (
        [f"{i}{j}" for i in range(k, k + rows) for j in range(k, k + width)],
        [str(n) for n in range(k, k + rows * width)],
    )
]
"""Shapes of pose and rotation matrices, each with the indices that name its elements."""
OF_ARM = re.compile(r"(?i)shoulder|elbow")
NO_PLACE_BEFORE_AXIS = re.compile(r"(?i)(?:^|[\W_])[ravwfmgq]$|-[avwq]-$")
"""Letters before an axis that mean an angle, a velocity, ..., as in `rx` and `hand-v-x`."""


def bodies_of(columns: Mapping[str, SeenColumn]) -> dict[str, list[str]]:
    """Columns x, y, z of each body, or x, y of a body in an image."""
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
        if last and last["axis"] == "W" and {last["body"] + a for a in "PR"} <= {*columns}:
            continue  # an angle of FANUC
        for match in filter(None, (last, AXIS_FIRST.fullmatch(bare))):
            if not NO_PLACE.search(match["body"]):
                found.setdefault(match["body"], {})[match["axis"].lower()] = name
    poses = _poses(columns)
    bodies = {body: place for body, (place, _) in poses.items() if place}
    parts = {name for both in poses.values() for names in both for name in names}
    sizes_of = Counter(NUMBERED.sub(r"\g<body>", name) for name in columns if OF_ARM.search(name))
    is_arm = any(size != 3 for size in sizes_of.values())  # then wrist_1 to wrist_3 are joints
    arrays: dict[str, set[int]] = {}  # sizes of the last axes
    for body, axes in found.items():
        arrays.setdefault(body.rpartition(".")[0], set()).add(len(axes))
    for body, axes in found.items():
        sizes = POSE_SIZES if POSE_NAME.search(body) else POSE_SIZES[:1]
        is_one = set(axes) == {*"123"} and not (is_arm or NO_PLACE_IN_ARRAY.search(body))
        one = int(is_one and ELEMENTS.match(axes["1"]) is not None)
        are_elements = set(axes) == set(map(str, range(one, one + len(axes))))
        is_pose = are_elements and len(axes) in sizes
        are_alike = len(arrays[body.rpartition(".")[0]]) == 1
        if are_elements and are_alike and LANDMARK.match(min(axes.values())):
            is_pose |= len(axes) == 2
            is_pose |= len(axes) == 4 and _are_seen(*(columns[axes[k]] for k in sorted(axes)))
        in_image = set("xy") <= set(axes) <= set("wxy") and body.rstrip("._ ")  # w: of a box
        # with w it is a quaternion
        if (set(axes) == set("xyz") or is_pose or in_image) and not parts & {*axes.values()}:
            bodies[body] = [axes[a] for a in sorted({*axes} - {"w"})][:3]
    return bodies


def _are_seen(*columns: SeenColumn) -> bool:
    """Whether the last of four columns may be the confidence of the position in the others."""
    last = columns[3].values[np.isfinite(columns[3].values)]
    return bool(np.all((last >= 0.0) & (last <= 1.0))) and not _is_unit(columns)


def _poses(columns: Mapping[str, SeenColumn]) -> dict[str, tuple[list[str], list[str]]]:
    """Columns of position and orientation of each pose in an array.

    Poses are matrices (T, 4, 4) or (T, 16), also transposed as in libfranka, (T, 3, 4), (T, 3, 3)
    without a position, or quaternions beside a position. Unnamed columns are one array.
    """
    arrays: dict[str, dict[str, str]] = {}
    for name in columns:
        if match := NUMBERED.fullmatch(name):
            *before, last = re.findall(r"\d+", match["at"])
            arrays.setdefault(match["body"], {})["".join([*before, last])] = name
            if before:
                arrays.setdefault(f"{match['body']}.{before[0]}", {})[last] = name
    found: dict[str, tuple[list[str], list[str]]] = {}
    for body, elements in arrays.items():
        names = [*elements.values()]
        for shape, kind in OF_MATRIX if len(names) in (9, 12, 16) else ():
            if {*kind} != {*elements}:
                continue
            matrix = np.array([elements[at] for at in kind]).reshape(shape)
            for one in (matrix, matrix.T) if shape == (4, 4) else (matrix,):
                last = [columns[name].farthest for name in one[3:].flat]
                is_unit = all(_is_unit([columns[name] for name in row[:3]]) for row in one[:3])
                if is_unit and last in ([], [0.0, 0.0, 0.0, 1.0]):
                    found.setdefault(body, (one[:3, 3:].ravel().tolist(), names))
        is_pose = len(names) == 7 and not NO_PLACE_IN_ARRAY.search(body)
        starts = _quaternions(columns, names) if is_pose or not body else []
        taken = {name for at in starts for name in names[at : at + 4]}
        taken |= {name for name in names if starts and is_even(np.diff(columns[name].values))}
        for at in starts:
            sides = names[max(at - 3, 0) : at], names[at + 4 : at + 7]
            place = next((of for of in sides if len(of) == 3 and not taken & {*of}), [])
            taken |= {*place}
            found[body or names[at]] = (place, names[at : at + 4])
    return found


def _quaternions(columns: Mapping[str, SeenColumn], names: Sequence[str]) -> list[int]:
    """Indices at which four successive columns, not all constant, are vectors of length 1."""
    found: list[int] = []
    for at in range(len(names) - 3):
        four = [columns[name] for name in names[at : at + 4]]
        is_free = at >= (found[-1] + 4 if found else 0)
        may_turn = all(one.moves or one.farthest < 1.0 for one in four)
        if is_free and may_turn and any(one.moves for one in four) and _is_unit(four):
            found.append(at)
    return found


def _is_unit(columns: Sequence[SeenColumn]) -> bool:
    """Whether the rows of some columns are vectors of length 1, or 0 where nothing was seen."""
    few = [one.values[:: max(1, one.values.size // 1000)] for one in columns]
    lengths = np.linalg.norm(few, axis=0)
    lengths = lengths[np.isfinite(lengths) & (lengths > 0.0)]
    return bool(lengths.size and np.all(np.abs(lengths - 1.0) < 0.01))


def orientations_of(
    columns: Mapping[str, SeenColumn], bodies: Mapping[str, Sequence[str]]
) -> set[str]:
    """Columns of orientations: quaternions, matrices, angles beside a position, and the elements
    of an array after its position.
    """
    arrays = {array_of(place[0]) for place in bodies.values()} - {""}
    rest = {name for name in columns if array_of(name) in arrays}
    rest |= {name for _, names in _poses(columns).values() for name in names}
    of = {name: match["body"] for name in columns if (match := NUMBERED.fullmatch(name))}
    sizes = Counter(filter(None, of.values()))  # no part of an array of joints is a quaternion
    others = [name for name in columns if name not in rest and sizes[of.get(name, "")] <= 4]
    rest |= {name for at in _quaternions(columns, others) for name in others[at : at + 4]}
    owners = {*bodies, *(PLACE_WORD.sub("", body) for body in bodies)}
    groups: dict[tuple[str, int], dict[str, str]] = {}  # by the body, and how many are whole
    for name in columns:
        bare = UNIT_END.sub("", ANGLE_END.sub("", name))
        turn, axis = TURN.fullmatch(bare), PLACES.match(bare)
        if turn and turn["body"] in owners:  # three angles, not a lone wrist_roll
            groups.setdefault((turn["body"], 3), {})[name] = name
        if axis:  # x, y, z, w, of whatever length
            groups.setdefault((axis["body"], 4), {})[axis["axis"].lower()] = name
    rest |= {n for (_, least), own in groups.items() if len(own) >= least for n in own.values()}
    return rest - {name for place in bodies.values() for name in place}


def is_marker_of(body: str, bodies: Sequence[str]) -> bool:
    """Whether a body is a marker `BODY:MARKER` of another one."""
    owner, colon, _ = body.partition(":")
    return bool(colon) and any(other.split(".")[0] == owner for other in bodies)


def commanded(names: Collection[str]) -> list[str]:
    """Columns that by their names are commanded, or later, copies of measured columns."""
    words = {name: [word.lower() for word in WORD.findall(name)] for name in names}
    bare = {
        name: tuple(w for w in of if w not in COMMANDS | MEASURED) for name, of in words.items()
    }
    said = {
        name for name, of in words.items() if COMMANDS & {w for k, w in enumerate(of) if k or w[1:]}
    }
    measured = {bare[name] for name in words if name not in said}
    return [name for name in words if name in said and bare[name] and bare[name] in measured]


def unclear_places(names: Sequence[str]) -> set[str]:
    """Columns x, y, z of bodies, no joints, in a unit that is unknown or with an axis twice."""
    found: dict[tuple[str, str], list[tuple[str, str]]] = {}
    for name in names:
        end = UNIT_END.search(name)
        unit = spelled(end["unit"] or "") if end else ""
        if (axis := PLACES.match(UNIT_END.sub("", name))) and unit not in ANGLES:
            found.setdefault((axis["body"], unit), []).append((axis["axis"].lower(), name))
    return {
        name
        for (_, unit), of in found.items()
        if {*"xyz"} <= {axis for axis, _ in of}
        and (len({*of}) < len(of) or (unit and unit not in LENGTHS))
        for _, name in of
    }


def array_of(name: str) -> str:
    """The array of which a column is an element: `q` for `q.0`, `q_0` and `q[0]`, "" for none."""
    match = re.fullmatch(r"(.*?)[._\[]\d+\]?", name)
    return match[1] if match else ""


def of_matrices(names: Collection[str]) -> set[str]:
    """Elements `NAME.i.j` of arrays of three rows or more, such as Jacobians; two may be arms."""
    rows: dict[str, dict[str, list[str]]] = {}
    for name in names:
        if match := re.fullmatch(r"(.*\D)\.(\d+)\.\d+", name):
            rows.setdefault(match[1], {}).setdefault(match[2], []).append(name)
    return {name for of in rows.values() if len(of) > 2 for row in of.values() for name in row}


def is_joint(name: str) -> bool:
    """Whether the name of a moving column may be that of a joint position."""
    axis = PLACES.match(UNIT_END.sub("", name))
    before = axis["body"] if axis and not axis["between"] else ""
    is_rate = before[-1:].lower() != "r" and NO_PLACE_BEFORE_AXIS.search(before) is not None
    return not (NO_JOINT.search(name) or TIME_NAME.search(name) or is_rate)


def counts_rows(column: SeenColumn) -> bool:
    """Whether a column counts rows, as frames and indices do."""
    first, steps = column.values[0], np.diff(column.values)
    is_count = are_counts(column, steps) and 0.0 <= first <= steps[0] and first % 1.0 == 0.0
    return is_count or bool(COUNT_NAME.search(column.name))


def is_even(steps: Floats) -> bool:
    """Whether numbers go on by nearly the same steps, as times and counts do."""
    return bool(steps.size and steps.min() > 0.8 * steps.max() > 0.0)


def are_counts(column: SeenColumn, steps: Floats) -> bool:
    """Whether steps are those of a count, not a clock: all the same whole number."""
    is_even = steps.size and column.values[0] < FIRST_CLOCK_S and np.ptp(steps) == 0.0
    return bool(is_even and steps[0] >= 1.0 and steps[0] % 1.0 == 0.0)
