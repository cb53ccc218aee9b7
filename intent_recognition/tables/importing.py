# SPDX-License-Identifier: Apache-2.0
"""Import demonstrations from tables and bags."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np

from intent_recognition.array_types import Flags, Floats, Integers
from intent_recognition.bags import NANOSECONDS
from intent_recognition.demonstrations import check_label, find_bags, reference_of
from intent_recognition.errors import BagError, DofError, MissingPackageError
from intent_recognition.signals import LONGEST_LABEL, Rejection, from_tangent, hidden_rows
from intent_recognition.tables.cells import Values, convert, numbers, text_of, texts
from intent_recognition.tables.doubts import Doubt, bag_doubts, certain_misfit, doubts
from intent_recognition.tables.files import find_tables, name_below, open_table
from intent_recognition.tables.flags import flags_of, seen_rows
from intent_recognition.tables.import_map import (
    PLACEHOLDER,
    ColumnsOf,
    Cut,
    ImportMap,
    Text,
    TimeSource,
)
from intent_recognition.tables.imported import (
    EntrySamples,
    ImportedBag,
    ImportedDemonstration,
    bag_parts,
)
from intent_recognition.tables.table import Table
from intent_recognition.tables.times import SAMPLES, counted_ns, restarts, stamps_ns

NO_SAMPLES = "Check its cells, and under time in the map where times come from."
NO_TIMES = "Save all digits of times; where samples come at a rate, say under time only: rate."
NO_TIME = "Say under time in the map which column holds it, or at which rate samples come."

Imported = ImportedDemonstration | ImportedBag


@dataclass(frozen=True)
class _Recording:
    """Files recorded together: their paths by key, and the placeholders' values in their names."""

    name: str
    paths: Mapping[str, Path]
    named: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class _Rows:
    """Rows of an entry's table: stamps, a mask of the known stamps, and the entry's values."""

    source: ColumnsOf
    stamps_ns: Integers
    known: Flags
    values: Floats
    zero_ns: int
    hidden: str  # note on rows of a hidden body, "" for none


def import_demonstrations(source: Path, mapping: ImportMap) -> Iterator[Imported | Rejection]:
    """Import the demonstrations of a file, folder or data set, or of bags for maps without columns.

    Yields:
        Demonstrations, rejections of files or parts of them, and oddities (`Doubt`).

    Raises:
        BagError: there is nothing to read.
    """
    taken: set[str] = set()
    are_bags = not any(column.columns for column in mapping.columns)
    paths = find_bags(source) if are_bags else find_tables(source)
    for recording in _find(source, paths, mapping):
        if isinstance(recording, Rejection):
            yield recording
            continue
        try:
            if are_bags:
                _check_name(recording.name)
                (path,) = recording.paths.values()
                parts: Iterable[Imported | Rejection]
                parts = [*bag_parts(recording.name, path, recording.named, mapping)]
                if not any(isinstance(part, Rejection) for part in parts):
                    yield from bag_doubts(recording.name, path, mapping.dofs)
            else:
                parts = _demonstrations(recording, mapping)
            for found in parts:
                if not isinstance(found, Rejection):
                    if found.name in taken:
                        cure = "Name each demonstration once, in the segments or by its file."
                        got = f"{found.name} twice"
                        raise BagError.about("recording", "names that differ", got, cure)
                    taken.add(found.name)
                yield found
        except (BagError, DofError, MissingPackageError) as error:
            (path, *others) = recording.paths.values()
            yield Rejection.of(recording.name if others else str(path), error)


def _find(
    source: Path, paths: Sequence[Path], mapping: ImportMap
) -> Iterator[_Recording | Rejection]:
    if not mapping.files:
        for path in paths:
            inside = name_below(source, path)
            name = inside if path.is_dir() else Path(inside).with_suffix("").as_posix()
            yield _Recording(name.replace("/", "_"), {"": path})
        return
    groups: dict[tuple[str, ...], dict[str, Path]] = {}
    named_in = dict.fromkeys(PLACEHOLDER.findall(next(iter(mapping.files.values()))))
    fields = sorted(named_in, key=lambda name: name != "task")  # the task first
    for name, pattern in mapping.files.items():
        expression = _expression(pattern)
        for path in paths:
            if found := expression.fullmatch(name_below(source, path)):
                key = tuple(found[one] for one in fields)
                groups.setdefault(key, {})[name] = path
    if not groups:
        patterns = ", ".join(mapping.files.values())
        got = ", ".join(name_below(source, path) for path in paths[:5])
        cure = "Correct the patterns under files in the map."
        raise BagError.about(str(source), f"files such as {patterns}", got, cure)
    for key, group in sorted(groups.items()):
        named = dict(zip(fields, key, strict=True))
        if missing := set(mapping.files) - set(group):
            wanted = ", ".join(mapping.files[name] for name in sorted(missing))
            there = ", ".join(path.name for path in group.values())
            yield Rejection(there, "", 0, f"missing file: {wanted} of the same recording")
        else:
            yield _Recording("_".join(key) or source.resolve().name, group, named)


def _expression(pattern: str) -> re.Pattern[str]:
    """A pattern of file names as a regular expression, with greedy placeholders."""
    text = re.escape(pattern)
    for name in dict.fromkeys(PLACEHOLDER.findall(pattern)):
        escaped = re.escape(f"{{{name}}}")
        text = text.replace(escaped, f"(?P<{name}>[^/]+)", 1).replace(escaped, f"(?P={name})")
    return re.compile(text)


def _demonstrations(
    recording: _Recording, mapping: ImportMap
) -> Iterator[ImportedDemonstration | Rejection]:
    _check_name(recording.name)
    tables = {name: open_table(path, mapping.skip_rows) for name, path in recording.paths.items()}
    for table in tables.values():
        mapping = mapping.over(table.defaults, str(table.source))
        for note in table.notes:
            yield Doubt(table.source.name, "", 0, note)
    data = _load(tables, mapping)
    rows = [_rows(source, tables[source.file], data[source.file], mapping.time)
            for source in mapping.columns]  # fmt: skip
    for row in filter(lambda row: row.hidden, rows):
        yield Doubt(recording.paths[row.source.file].name, "", 0, row.hidden)
    main = mapping.columns[0].file
    labels = {key: text for key, text in recording.named.items() if key != "task"}
    stamps, starts = rows[0].stamps_ns, list[int]()
    if mapping.segments is None and all(np.array_equal(row.stamps_ns, stamps) for row in rows):
        starts = restarts(stamps, rows[0].known)
    if starts:
        said = f"times begin anew: cut into {len(starts) + 1} parts"
        yield Doubt(recording.name, "", 0, said)
    parts_ = _parts(recording, mapping, rows, data, starts)
    for name, picks, first, cut in _cut_at_tasks(parts_, mapping, rows, data[main]):
        named = recording.named.get("task", "")
        said = _text_at(mapping.task, data[main], first) if mapping.task is not None else named
        task = mapping.label_of(cut, said)
        texts_ = {key: _text_at(t, data[main], first) for key, t in mapping.metadata.items()}
        origin = {"imported_from": ", ".join(p.name for p in recording.paths.values())}
        custom = {**labels, **origin, **{k: text for k, text in texts_.items() if text}}
        try:
            if task:
                check_label(task, "Give it another under labels in the map.")
                custom["task"] = task
        except BagError as error:  # rejects only this demonstration
            yield Rejection.of(name, error)
            continue
        parts = [_samples(row, pick, mapping.every) for row, pick in zip(rows, picks, strict=True)]
        few = [k for k, (s, _) in enumerate(parts) if _count(s) < (1 if s.entry.context else 2)]
        if few:
            topic = f"/{parts[few[0]][0].entry.topic}"
            yield Rejection(
                name, topic, 0, *_why_few(rows[few[0]], picks[few[0]], _count(parts[few[0]][0]))
            )
            continue
        if (odd := certain_misfit([s for s, _ in parts])) is not None:
            yield Rejection(name, "", 0, odd)
            continue
        yield from (Doubt(name, "", 0, doubt) for doubt in doubts(parts))
        yield ImportedDemonstration(
            name, custom, tuple(s for s, _ in parts), mapping.frame, sum(n for _, n in parts)
        )


def _load(tables: Mapping[str, Table], mapping: ImportMap) -> dict[str, dict[str, Values]]:
    """Read all columns that the map names once, by file and name."""
    wanted: dict[str, list[str]] = {name: [] for name in tables}
    for source in mapping.columns:
        wanted[source.file] += source.columns
        time = source.time or mapping.time
        wanted[source.file] += time.columns if time is not None else ()
        wanted[source.file] += _flags(source, tables[source.file])
    main = mapping.columns[0].file
    spoken = [mapping.task, *mapping.metadata.values()]
    wanted[main] += [text.column for text in spoken if text is not None and text.column]
    if isinstance(mapping.segments, str):
        if len({source.file for source in mapping.columns}) > 1:
            expected = "a list of start and end where a recording has several files"
            raise BagError.about("segments", expected, "a column", "Correct the map.")
        wanted[main].append(mapping.segments)
    return {name: table.columns(wanted[name]) for name, table in tables.items()}


def _rows(
    source: ColumnsOf, table: Table, data: Mapping[str, Values], time: TimeSource | None
) -> _Rows:
    time = source.time or time
    if time is None:
        raise BagError.about(str(table.source), "times, or a rate", "neither", NO_TIME)
    if not source.columns:
        cure = "Name its columns in the map: columns."
        raise BagError.about(f"{table.source}: {source.entry.topic}", "columns", "none", cure)
    columns = [_column(source, table, name, data[name]) for name in source.columns]
    sizes = {name: column.size for name, column in zip(source.columns, columns, strict=True)}
    sizes |= {name: data[name].size for name in time.columns}
    if len(set(sizes.values())) > 1:
        got = ", ".join(f"{name} {size}" for name, size in sizes.items())
        cure = "Name a time column of the same length, under time of the entry."
        raise BagError.about(str(table.source), "columns of one length", got, cure)
    values = np.column_stack(columns)
    flags = {name: data[name] for name in _flags(source, table)}
    unseen = ~seen_rows(flags, len(values))
    values[unseen] = np.nan
    said = f"by {', '.join(flags)} the body was not seen in some rows: they are not measured"
    said *= bool(unseen.any())
    if source.entry.orientation and values.shape[1] == 3:  # as `intent export` writes it
        values = from_tangent(values, reference_of(source.entry))
    if source.entry.unit == "m" and len(source.entry.fields) == 3:
        hidden = hidden_rows(values, table.must_say)
        if hidden.any():
            marker = source.columns[0].rpartition(".")[0] or source.entry.topic
            at = ", ".join(f"{number:.6g}" for number in values[hidden][0])
            said += "; " * bool(said)
            said += f"frames at exactly ({at}) are taken for occlusion: {marker} {hidden.sum()}"
        values = np.where(hidden[:, None], np.nan, values)
    if time.column is None or time.unit == SAMPLES:
        if time.column is not None:
            counts = numbers(data[time.column], table.source, time.column)
        elif table.counts is not None:
            counts = table.counts()[: len(values)]
        else:
            counts = np.arange(len(values), dtype=np.float64)
        stamps = counted_ns(counts, time.rate_hz, time.since_ns, table.source)
    else:
        place = (table.source, time.column)
        unit = time.unit or table.time_unit_of(time.column) or "s"
        stamps = stamps_ns(data[time.column], unit, time.since_ns, *place)
    ns, known = stamps.ns, stamps.known
    if time.nanoseconds:
        more = numbers(data[time.nanoseconds], table.source, time.nanoseconds)
        known = known & np.isfinite(more)
        ns = ns + np.where(known, more, 0.0).astype(np.int64)
    return _Rows(source, ns, known, values, stamps.zero_ns, said)


def _flags(source: ColumnsOf, table: Table) -> list[str]:
    """Columns that say when the body of an entry was seen; none for joints."""
    number = table.find(source.columns[0]) if source.columns and not source.entry.joints else None
    return [] if number is None else flags_of(table.names, table.names[number])


def _column(source: ColumnsOf, table: Table, name: str, cells: Values) -> Floats:
    """A column as numbers in the unit of its entry."""
    values = numbers(cells, table.source, name)
    if source.entry.orientation:  # a quaternion has no unit
        return values
    unit = source.unit or table.unit_of(name, source.entry.unit)
    return convert(values, unit, source.entry.unit)


def _parts(
    recording: _Recording,
    mapping: ImportMap,
    rows: Sequence[_Rows],
    data: Mapping[str, Mapping[str, Values]],
    starts: Sequence[int],
) -> Iterator[tuple[str, list[Integers], int, Cut | None]]:
    """For each demonstration: name, rows of each entry, first row of the first entry, and cut."""
    if starts:
        for k, (start, stop) in enumerate(pairwise([0, *starts, rows[0].stamps_ns.size])):
            yield f"{recording.name}_{k:03d}", [np.arange(start, stop)] * len(rows), start, None
    elif mapping.segments is None:
        yield recording.name, [np.arange(row.stamps_ns.size) for row in rows], 0, None
    elif isinstance(mapping.segments, str):
        values = texts(data[mapping.columns[0].file][mapping.segments])
        changes = [k for k in range(1, len(values)) if values[k] != values[k - 1]]
        runs = [(a, b) for a, b in pairwise([0, *changes, len(values)]) if values[a]]
        names = [values[a] for a, _ in runs]
        for k, (start, stop) in enumerate(runs):
            own = len(set(names)) == len(names) and not values[start].isdigit()
            name = values[start] if own else f"{recording.name}_{k:03d}"
            _check_name(name)
            yield name, [np.arange(start, stop)] * len(rows), start, None
    else:
        cuts = [cut for cut in mapping.segments if cut.file in ("", recording.name)]
        for k, cut in enumerate(cuts):
            picks = [_between(row, cut, rows[0].zero_ns) for row in rows]
            first = int(picks[0][0]) if picks[0].size else 0
            name = recording.name if len(cuts) == 1 else f"{recording.name}_{k:03d}"
            yield name, picks, first, cut


def _cut_at_tasks(
    parts: Iterator[tuple[str, list[Integers], int, Cut | None]],
    mapping: ImportMap,
    rows_of: Sequence[_Rows],
    data: Mapping[str, Values],
) -> Iterator[tuple[str, list[Integers], int, Cut | None]]:
    """Cut parts where the value in the task column changes; empty cells continue the task before.

    Entries with the same times as the first entry are cut at the same rows, others by time.
    """
    main = rows_of[0]
    latest_ns = np.maximum.accumulate(np.where(main.known, main.stamps_ns, 0))
    column = mapping.task.column if mapping.task is not None else ""
    for name, picks, first, cut in parts:
        labels = texts(data[column]) if column and data[column].size > 1 else []
        rows = [k for k in picks[0].tolist() if labels and labels[k]]
        starts = [b for a, b in pairwise(rows) if labels[a] != labels[b]]
        if (cut is not None and cut.task) or not starts:
            yield name, picks, rows[0] if rows else first, cut
            continue
        parts_of = [
            np.searchsorted(starts, pick, "right")
            if np.array_equal(row.stamps_ns, main.stamps_ns)
            else np.searchsorted(latest_ns[starts], row.stamps_ns[pick], "right")
            for row, pick in zip(rows_of, picks, strict=True)
        ]
        for k, own in enumerate([rows[0], *starts]):
            inside = [pick[of == k] for pick, of in zip(picks, parts_of, strict=True)]
            yield f"{name}_task_{k}", inside, own, cut


def _between(rows: _Rows, cut: Cut, zero_ns: int) -> Integers:
    start_ns, end_ns = (zero_ns + round(s * NANOSECONDS) for s in (cut.start_s, cut.end_s))
    return np.flatnonzero(rows.known & (rows.stamps_ns >= start_ns) & (rows.stamps_ns <= end_ns))


def _samples(rows: _Rows, pick: Integers, every: int) -> tuple[EntrySamples, int]:
    """Samples of an entry with increasing times, and the number of dropped ones."""
    pick = pick[::every]
    stamps = rows.stamps_ns[pick]
    latest = np.maximum.accumulate(np.where(rows.known[pick], stamps, 0))
    before = np.concatenate([[0], latest[:-1]])[: stamps.size]
    kept = rows.known[pick] & (stamps > before)
    found = EntrySamples(rows.source.entry, stamps[kept], rows.values[pick[kept]])
    return found, int(np.sum(~kept))


def _why_few(rows: _Rows, pick: Integers, count: int) -> tuple[str, str]:
    """Why so few samples are left, and the cure."""
    stamps = rows.stamps_ns[pick][rows.known[pick]]
    if pick.size and not stamps.size:
        return "no row has a time", NO_TIMES
    if stamps.size > 1 and np.all(np.diff(stamps) <= 0):
        if stamps[0] == stamps[-1]:
            return "all rows have the same time", NO_TIMES
        return "times decrease from row to row", "Reverse the rows of the file."
    if stamps.size and not np.isfinite(rows.values[pick]).any():
        return "every cell is empty, or not measured", "Name other columns in the map."
    number = count or "no"
    return f"empty: {number} sample{'s' * (count != 1)} with a time of its own", NO_SAMPLES


def _count(samples: EntrySamples) -> int:
    """Number of samples in which something was measured."""
    return int(np.any(np.isfinite(samples.values), axis=1).sum())


def _text_at(text: Text, data: Mapping[str, Values], row: int) -> str:
    if not text.column:
        return text.fixed
    values = data[text.column]
    return text_of(values[row if values.size > 1 else 0])


def _check_name(name: str) -> None:
    sound = name.isprintable() and not set("/\\") & set(name) and name[:1] not in ("", ".", "-")
    if not sound or len(name) > LONGEST_LABEL:
        expected = f"a name for a folder, of 1 to {LONGEST_LABEL} characters"
        raise BagError.about("recording", expected, repr(name), "Rename it.")
