# SPDX-License-Identifier: Apache-2.0
"""Suggests a first map from what a table holds: positions, moving columns, times, units."""

import re
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import chain, groupby
from pathlib import Path
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.bags import NANOSECONDS
from intent_recognition.demonstrations import find_bags
from intent_recognition.errors import BagError, printable
from intent_recognition.signals import LONGEST_LABEL, NONE, can_name_task, hidden_rows
from intent_recognition.tables.cells import OF_IMAGE, numbers, texts
from intent_recognition.tables.files import MOST_TRIED, FileKind, file_kinds, find_tables, tables_at
from intent_recognition.tables.flags import flags_of, seen_rows
from intent_recognition.tables.suggested_entries import (
    MOST_SUGGESTED,
    SeenColumn,
    body_entry,
    distinct,
    flow,
    is_angle,
    is_length,
    joints_entry,
    note_on_observed,
    person_first,
    suggest_of_bags,
)
from intent_recognition.tables.suggested_names import (
    NO_TASK,
    SEGMENT_NAME,
    TASK_NAME,
    are_counts,
    array_of,
    bodies_of,
    commanded,
    counts_rows,
    is_even,
    is_joint,
    is_marker_of,
    of_matrices,
    orientations_of,
    unclear_places,
)
from intent_recognition.tables.table import Table
from intent_recognition.tables.times import PER_UNIT, TIME_NAME, stamps_ns, usual_unit

LONGEST_NAME = 300
"""Longest name of a column that is considered; some patterns take the square of this time. Names of
topics and fields have about a hundred characters."""
MOST_LISTED = 12
"""Most columns of a kind that a comment lists."""
MOST_JOINTS = 16
"""Most joints in a suggestion: two arms with a hand."""
NANOSECONDS_NAME = re.compile(r"(?i)(^|[^a-z]|zeit)n(ano)?secs?$|nanoseconds?$|_ns$")
"""Names of a column of nanoseconds beside a column of whole seconds."""
MOSTLY, REPEATED = 0.9, 0.3
"""Least share of times later than the time before, if some go back and if some only repeat. A file
holds few demonstrations in succession; a clock may be three times slower than the rows."""
INDEX = ("0", "__index_level_0__")
"""Names of a first column without a name, and of pandas' index in Parquet."""
LEAST_MS = 5.0
"""Shortest even step from 0 on that may be unnamed milliseconds rather than every n-th row: robots
that log above 200 Hz name the unit."""
NO_RATE = "not in the file: give the rate in Hz"
"""Comment on a time that is disabled until somebody corrects it."""


def suggest_map(source: Path) -> str:
    """Suggest the text of a map for a source, with comments, for the user to correct.

    Recordings of several files, in a folder for each kind, get entries for each kind.

    Raises:
        BagError: nothing in the source can be read or suggested.
    """
    if source.exists() and not tables_at(source) and (bags := find_bags(source)):
        return suggest_of_bags(source, bags)
    paths, errors = find_tables(source), list[BagError]()
    while paths and len(errors) < MOST_TRIED:
        kinds: list[FileKind] = []
        try:
            kinds = file_kinds(source, paths)
            return _map_of(kinds)
        except BagError as error:
            errors.append(error)
            paths = [path for path in paths if path != kinds[0].table.source] if kinds else []
    raise errors[0]


def _map_of(kinds: Sequence[FileKind]) -> str:
    """The text of a map of kinds of files, by the first of each."""
    several = len(kinds) > 1
    of_kinds = [(kind, _suggest(kind, kind.name if several else "")) for kind in kinds]
    parts = [part for _, of_kind in of_kinds for part in of_kind]
    taken = [kind for kind, of in of_kinds if any(part.bodies + part.others for part in of)]
    found = [entry for part in parts for entry in (*part.bodies, *part.others)]
    entries = distinct(person_first(found))
    if not entries:
        table = kinds[0].table
        twice = _twice(table)
        got = f"none but {', '.join(twice[:MOST_LISTED])}, each twice" if twice else "none"
        by_number = "Name columns by their numbers, from 0 on, in a map of your own."
        there = [f"{line.removeprefix('# ')}." for line in parts[0].left_out if not twice]
        cure = " ".join(
            [*table.notes, *_columns(table)[2], *there, by_number if twice else "Check the file."]
        )
        raise BagError.about(str(table.source), "places or angles that move", got, cure)
    lines = [
        *(f"# Suggested from {part.source}" for part in parts),
        "# Delete what you do not need, name the topics, move the robot's to `controlled`.",
        *(f"# Note: {note}" for part in parts for note in part.notes),
        *note_on_observed(entries),
        *_files(taken, several),
        "observed:",
        *entries[0],
        *(["controlled:"] if entries[1:] else []),
        *chain(*entries[1:]),
        *(line for part in parts for line in part.times),
        *next((part.tasks for part in parts if part.tasks), []),
        *(line for part in parts for line in part.left_out),
    ]
    return "\n".join(lines) + "\n"


def _twice(table: Table) -> list[str]:
    return [name for name, count in Counter(table.names).items() if name and count > 1]


class _Part(NamedTuple):
    """Lines that a kind of file contributes to a map."""

    source: str
    notes: Sequence[str]
    bodies: list[list[str]]
    others: list[list[str]]
    times: list[str]
    tasks: list[str]
    left_out: list[str]


def _suggest(kind: FileKind, name: str) -> list[_Part]:
    """The parts of a kind of file, one for each length of columns, that with most numbers first.

    Columns of another length, such as at another rate, have times of their own.
    """
    columns, labels, _ = _columns(kind.table)
    of_size: dict[int, dict[str, SeenColumn]] = {}
    for one in columns.values():
        if one.values.size > 1:
            of_size.setdefault(one.values.size, {})[one.name] = one
    in_order = sorted(of_size, key=lambda size: -len(of_size[size]) * size)
    main, *others = [of_size[size] for size in in_order] or [{}]
    found = _part(kind, name, main, labels)
    rest = [(of, _part(kind, name, of, {}, is_main=False)) for of in others]
    left = [column for of, part in rest if not part.bodies + part.others for column in of]
    left_out = [*found.left_out, *_line("Of other lengths", left)]
    more = (part for _, part in rest if part.bodies + part.others)
    return [found._replace(left_out=left_out), *more]


def _line(title: str, names: Sequence[str]) -> list[str]:
    """A comment that lists columns; no line without columns."""
    more = [f"and {len(names) - MOST_LISTED} more"] if names[MOST_LISTED:] else []
    return [f"# {title}: {', '.join([*names[:MOST_LISTED], *more])}"] if names else []


def _part(
    kind: FileKind,
    name: str,
    columns: Mapping[str, SeenColumn],
    labels: Mapping[str, list[str]],
    is_main: bool = True,
) -> _Part:
    """The part for columns of one length; its entries name the file if `name` is given."""
    table = kind.table
    rows = max((one.values.size for one in columns.values()), default=0)
    later = commanded(columns)
    columns = {name: one for name, one in columns.items() if name not in later}
    cut = _cut(table, columns, labels)
    bodies = {b: names for b, names in bodies_of(columns).items() if is_length(table, names[0])}
    places = {column for body in bodies.values() for column in body}
    turning = orientations_of(columns, bodies)
    time, time_note = _time(table, columns, labels, cut, places | turning)
    used = {str(time.get("column", "")), str(time.get("nanoseconds", "")), cut, *places, *turning}
    flags = {b: flags_of(table.names, names[0]) for b, names in bodies.items()}
    used |= {name for of in flags.values() for name in of}
    joints = [c for c in columns.values() if c.moves and c.name not in used and not counts_rows(c)]
    matrices = of_matrices(columns)
    angles = {c.name for c in joints if is_joint(c.name) and is_angle(table, c.name)}
    unclear = unclear_places(table.names) & angles
    others = [
        c.name
        for c in joints
        if c.name not in angles - matrices - unclear or np.unique(c.values).size < 3
    ]
    joints = [c for c in joints if c.name not in others]
    sizes = Counter(array_of(joint.name) for joint in joints)
    still = [c.name for c in columns.values() if not c.moves and c.name not in used]
    moving = [body for body, names in bodies.items() if any(columns[n].moves for n in names)]
    often = max((columns[bodies[body][0]].seen for body in moving), default=0.0)
    seldom = [body for body in moving if columns[bodies[body][0]].seen < 0.5 * often]
    markers = [b for b in moving if b not in seldom and is_marker_of(b, moving)]
    moving = [b for b in moving if b not in (*seldom, *markers)]
    time_line = f"{'# ' * (time_note == NO_RATE)}time: {flow(time)}  # {time_note}"
    own = [f"    file: {flow(name)}"] * bool(name)
    own += [f"    {time_line}"] * bool(name or not is_main)
    measured = {}
    for body in moving:
        values = np.column_stack([columns[n].values for n in bodies[body]])
        values[~seen_rows(table.columns(flags[body]), len(values))] = np.nan
        measured[body] = np.where(hidden_rows(values, True)[:, None], np.nan, values)
    unsaid = (of for body, of in measured.items() if not table.said_of(bodies[body][0]))
    farthest = max((float(np.nanmax(np.abs(of))) for of in unsaid), default=0.0)
    is_mediapipe = any("visibility" in name.lower() for name in columns)
    flat = [of[:, :2] for of in measured.values() if is_mediapipe]
    in_image = flat and all(np.nanmin(of) >= 0.0 and np.nanmax(of) <= 1.0 for of in flat)
    found = [
        body_entry(table, measured[body], body, bodies[body], farthest, name) + own
        for body in moving[:MOST_SUGGESTED]
    ]
    arm = [
        joints_entry(table, list(array)) + own
        for _, array in groupby(
            joints[:MOST_JOINTS],
            key=lambda joint: array_of(joint.name) if sizes[array_of(joint.name)] > 3 else "",
        )  # wrist_1 to wrist_3 are of an arm
    ]
    if not is_main and (cut or not TIME_NAME.search(str(time.get("column", "")))):
        found = arm = []
    left_out = {
        "They do not move": still,
        "They move, and are no positions": [name for name in others if name not in unclear],
        "Places in an unknown unit, or with an axis twice: say columns_unit, or name them by"
        " number, in a map of your own": [name for name in others if name in unclear],
        "Orientations": [n for n in columns if n in turning],
        "They say when a body was seen": [*dict.fromkeys(chain(*flags.values()))],
        "Markers of these bodies": markers,
        "Seldom seen": seldom,
        "The same, a step later, or as commanded": later,
        "There twice: name them by number": _twice(table) if is_main else [],
        "More bodies that move": moving[MOST_SUGGESTED:],
        "More columns that move": [c.name for c in joints[MOST_JOINTS:]],
    }
    return _Part(
        f"{kind.first}: {rows} rows, {len(table.names)} columns.",
        (*table.notes, *[OF_IMAGE][: bool(in_image)]) if is_main else (),
        found,
        arm,
        [] if name or not is_main else [time_line],
        [*_of_texts(kind, labels, used, cut)] if is_main else [],
        [line for title, names in left_out.items() for line in _line(title, names)],
    )


def _files(kinds: Sequence[FileKind], several: bool) -> Iterator[str]:
    """Patterns of file names, if they contain the task or the files of one recording."""
    if several:
        yield "files:  # of one recording"
        for kind in kinds:
            yield f"  {kind.name}: {flow(kind.pattern)}"
    elif "{task}" in kinds[0].pattern:
        yield f"files: {flow(kinds[0].pattern)}"


def _columns(table: Table) -> tuple[dict[str, SeenColumn], dict[str, list[str]], list[str]]:
    """Columns with unique names: numbers, texts, and why the first text is no number."""
    found: dict[str, SeenColumn] = {}
    labels: dict[str, list[str]] = {}
    why: list[str] = []
    names = [name or str(k) for k, name in enumerate(table.names)]  # pandas' index has none
    counts = Counter(names)
    alone = [k for k, n in enumerate(names) if counts[n] == 1 and len(n) <= LONGEST_NAME]
    for start in range(0, len(alone), 50):  # so that not all of many columns are in memory
        part = alone[start : start + 50]
        for k, cells in zip(part, table.read(part), strict=True):
            name = names[k]
            if cells.dtype.kind == "m":
                cells = cells / np.timedelta64(1, "s")
            try:
                values = numbers(cells, table.source, name)
            except (BagError, ValueError, TypeError) as error:
                labels[name] = texts(cells)
                why = why or [str(error)]
                continue
            seen = values[np.isfinite(values)]
            if TASK_NAME.fullmatch(name) and 1 < np.unique(seen).size <= MOST_LISTED:
                labels[name] = texts(cells)
            if seen.size:
                farthest = float(np.abs(seen).max())
                moves = bool(np.ptp(seen) > 1e-9 * max(1.0, farthest))  # not by rounding
                found[name] = SeenColumn(name, values, moves, seen.size / values.size, farthest)
    return found, labels, why


def _cut(
    table: Table, columns: Mapping[str, SeenColumn], labels: Mapping[str, Sequence[str]]
) -> str:
    """The column whose value changes with each demonstration; "" for none."""
    said = table.defaults.get("segments")
    if isinstance(said, Mapping):
        return str(said.get("column"))
    whole = [n for n, c in columns.items() if c.moves and np.all(np.floor(c.values) == c.values)]
    return next((name for name in (*whole, *labels) if SEGMENT_NAME.fullmatch(name)), "")


def _time(
    table: Table,
    columns: Mapping[str, SeenColumn],
    labels: Mapping[str, Sequence[str]],
    cut: str,
    taken: Collection[str],
) -> tuple[dict[str, object], str]:
    """The `time` entry and its comment: from the file, names of columns, dates, a first column."""
    said = table.defaults.get("time")
    if isinstance(said, Mapping):
        rate = said.get("rate")
        return dict(said), f"from the file{f', {rate:g} Hz' if isinstance(rate, float) else ''}"
    of = np.array(labels.get(cut) or (columns[cut].values if cut in columns else []))
    inside = of[1:] == of[:-1] if of.size else slice(None)  # each may begin at time 0
    dates = next((name for name, cells in labels.items() if _are_later(table, name, cells)), "")
    named = [c for c in columns.values() if c.name in INDEX or TIME_NAME.search(c.name)]
    first = [] if dates or any(map(TIME_NAME.search, labels)) else [*columns.values()][:1]
    # times in any language grow by nearly equal steps that are no count
    even = [c for c in first if is_even(by := np.diff(c.values)[inside]) and not are_counts(c, by)]
    for column in [c for c in (*named, *even) if c.name not in taken]:
        steps = np.diff(column.values)[inside]
        if not steps.size:
            continue
        if np.all(steps < 0.0):
            return {"column": column.name}, "it decreases: reverse the rows of the file"
        said_unit = table.time_unit_of(column.name)
        is_named = column.name not in INDEX and TIME_NAME.search(column.name)
        by_few = steps[0] < LEAST_MS and column.values[0] <= steps[0]
        if not said_unit and are_counts(column, steps) and (by_few or not is_named):
            continue
        later = steps > 0.0
        often = np.mean(later) > (MOSTLY if np.any(steps < 0.0) else REPEATED)
        if often and (unit := usual_unit(steps[later], said_unit, np.nanmin(column.values))):
            rate_hz = NANOSECONDS / (PER_UNIT[unit] * float(np.median(steps[later])))
            odd = "" if np.all(later) else f", {np.sum(~later)} times repeat or go back"
            return {"column": column.name, "unit": unit}, f"{rate_hz:.4g} Hz then{odd}"
        if np.all(steps >= 0.0) and np.all(np.floor(column.values) == column.values):
            for more in columns.values():
                unnamed = column.name == "0" and more.name == "1" and _are_nanoseconds(more.values)
                if NANOSECONDS_NAME.search(more.name) or unnamed:
                    both: dict[str, object] = {"column": column.name, "nanoseconds": more.name}
                    return both, "seconds and nanoseconds"
    if dates:
        return {"column": dates}, "dates, or times of day"
    return {"rate": 100}, NO_RATE


def _are_later(table: Table, name: str, cells: Sequence[str]) -> bool:
    """Whether texts are dates or times of day, each later than the one before."""
    try:
        ns = stamps_ns(np.array(cells, object), "s", None, table.source, name).ns
    except BagError:
        return False
    return ns.size > 1 and bool(np.all(np.diff(ns) > 0))


def _are_nanoseconds(values: Floats) -> bool:
    """Whether numbers may be nanoseconds beside whole seconds, as in `ros2 topic echo --csv`."""
    inside = (values >= 0.0) & (values < NANOSECONDS) & (np.floor(values) == values)
    return bool(np.all(inside) and values.max() >= NANOSECONDS // 1000)


def _of_texts(
    kind: FileKind, labels: Mapping[str, Sequence[str]], used: Collection[str], cut: str
) -> Iterator[str]:
    """Lines that say where demonstrations begin and which column holds their label."""
    table = kind.table
    for key in ("segments", "task"):
        if isinstance(said := table.defaults.get(key), Mapping):
            yield f"{key}: {flow(dict(said))}  # from the file"
            if key == "task":
                yield from _new_labels(labels.get(str(said.get("column")), []))
    if cut and "segments" not in table.defaults:
        yield f"segments: {flow({'column': cut})}  # by its name"
    if "task" in table.defaults:
        return
    has_task = "{task}" in kind.pattern
    for name, values in labels.items():
        kinds = sorted(set(filter(None, values)))
        if name in used or NO_TASK.search(name) or len(kinds) > MOST_LISTED:
            continue
        is_task = bool(TASK_NAME.fullmatch(name)) and not has_task
        has_task |= is_task
        shown = printable(", ".join(kinds))
        line = f"task: {flow({'column': name})}  # it says: {shown}"[:200]
        yield line if is_task else f"# {line}"
        if is_task:
            yield from _new_labels(kinds)
    if not has_task:
        yield "task: give_it_a_name"


def _new_labels(said: Sequence[str]) -> Iterator[str]:
    """A line with new labels for texts that cannot name a task, such as long sentences."""
    new: dict[str, str] = {}
    for text in dict.fromkeys(filter(None, said)):
        if not can_name_task(text):
            label = re.sub(r"[^\w ,.'-]+", "_", text).strip(" ._-")
            if len(label) > LONGEST_LABEL:
                label = label[: LONGEST_LABEL - 10].rpartition(" ")[0]
            taken = not label or label == NONE or label in (*said, *new.values())
            new[text] = f"{label or 'task'} {len(new)}" if taken else label
    if new:
        yield f"labels: {flow(new)}  # these cannot name a task"
