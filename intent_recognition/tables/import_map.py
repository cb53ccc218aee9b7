# SPDX-License-Identifier: Apache-2.0
"""Read the map of an import: a DOF file with the columns of its degrees of freedom."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

from intent_recognition.bags import NANOSECONDS
from intent_recognition.demonstrations import DofEntry, DofSpec
from intent_recognition.errors import DofError
from intent_recognition.tables.cells import check_convertible
from intent_recognition.tables.times import PER_UNIT, SAMPLES
from intent_recognition.untrusted import UntrustedError, load_yaml, read_text

SIDES, EXTRINSICS = ("observed", "controlled", "velocities"), "extrinsics"
ENTRY_KEYS = ("columns", "columns_unit", "file", "time")
"""Keys of an entry beyond those of a DOF file."""
KEYS = (*SIDES, EXTRINSICS, "files", "time", "segments", "every", "task", "labels", "metadata",
        "frame", "skip_rows")  # fmt: skip
LARGEST = 1e12
"""Largest accepted time or rate [s, Hz]; times in seconds since 1970 are about 2e9."""
EXAMPLES = "docs/import.md has examples."
AXIS = re.compile(r"(?i)([wxyz])[\W_]*$")
"""The axis at the end of a column's name."""
PLACEHOLDER = re.compile(r"\{(\w+)\}")


class TimeSource(NamedTuple):
    """Source of the times of samples."""

    column: str | None  # column of times; None if samples have a constant rate
    unit: str  # of the column, a key of `PER_UNIT`; "" for the file's unit, by default seconds
    rate_hz: float
    since_ns: int | None  # time zero [ns since 1970]; None if the map does not give it
    nanoseconds: str = ""  # column of nanoseconds to add to `column`, "" for none

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns from which the times are computed."""
        return tuple(filter(None, (self.column, self.nanoseconds)))


@dataclass(frozen=True)
class ColumnsOf:
    """Source of the values of one entry of the DOF file."""

    entry: DofEntry
    columns: tuple[str, ...]  # one for each DOF, in order; empty if bags are imported
    unit: str  # of the columns, "" for the file's unit, by default that of the entry
    file: str  # key of the recording's file under `files`, "" if it has only one
    time: TimeSource | None  # the entry's own times, None for those of the map


class Cut(NamedTuple):
    """One segment of a list, in seconds of the file's own clock, including both ends."""

    start_s: float
    end_s: float
    task: str  # label of the segment, "" for that of the map
    file: str  # name of its recording, "" for all recordings


class Text(NamedTuple):
    """A text of each demonstration, either fixed or taken from a column."""

    column: str  # column whose first value is taken, "" for none
    fixed: str  # the text if there is no column


@dataclass(frozen=True)
class ImportMap:
    """Content of a map, which describes files to `intent import`."""

    dofs: DofSpec  # degrees of freedom of the demonstrations
    columns: tuple[ColumnsOf, ...]  # source of each entry, in the order of `dofs`
    # name patterns of the files of a recording, by key; empty if each file is a recording
    files: Mapping[str, str]
    time: TimeSource | None  # source of the times, None for the file's default
    # a column whose value changes with the demonstration, or a list of cuts
    segments: str | tuple[Cut, ...] | None
    every: int  # step between the rows of a demonstration that are imported
    task: Text | None  # label; None for that of the file or its name
    labels: Mapping[str, str]  # new labels by the labels in the file
    metadata: Mapping[str, Text]  # further texts of each demonstration
    frame: str  # frame of poses
    skip_rows: int  # number of lines before the header of a CSV

    @classmethod
    def from_dict(cls, content: object, source: str = "map") -> "ImportMap":
        """Check the content of a map and build it; `source` names it in errors."""
        items = _mapping(content, source, KEYS)
        own: dict[str, list] = {side: items.get(side) or [] for side in SIDES}
        plain: dict[str, object] = {}
        if isinstance(own["observed"], list):  # in the order of `_entries`
            own["observed"] = sorted(own["observed"], key=_is_context)
        for side, listed in own.items():
            if not isinstance(listed, list):
                raise _error(f"{source}: {side}", "a list of entries", listed)
            plain[side] = [
                {k: v for k, v in item.items() if k not in ENTRY_KEYS}
                if isinstance(item, Mapping)
                else item
                for item in listed
            ]
        plain |= {EXTRINSICS: items.get(EXTRINSICS)}
        dofs = DofSpec.from_dict({k: v for k, v in plain.items() if v or k == "observed"}, source)
        files = _files(items.get("files", {}), f"{source}: files")
        columns = tuple(
            _columns(item, entry, files, f"{source}: {side}[{k}]")
            for side in SIDES
            for k, (item, entry) in enumerate(zip(own[side], _entries(dofs, side), strict=True))
        )
        labels = _mapping(items.get("labels", {}), f"{source}: labels")
        metadata = _mapping(items.get("metadata", {}), f"{source}: metadata")
        return cls(
            dofs,
            columns,
            files,
            _time(items["time"], f"{source}: time") if "time" in items else None,
            _segments(items.get("segments"), f"{source}: segments"),
            _count(items.get("every", 1), 1, f"{source}: every"),
            _text(items["task"], f"{source}: task") if "task" in items else None,
            {str(before): str(after) for before, after in labels.items()},
            {str(k): _text(v, f"{source}: metadata: {k}") for k, v in metadata.items()},
            str(items.get("frame", "world")),
            _count(items.get("skip_rows", 0), 0, f"{source}: skip_rows"),
        )

    def label_of(self, cut: Cut | None, otherwise: str) -> str:
        """The label of a demonstration, which has another unless its cut names one."""
        label = (cut.task if cut is not None else "") or otherwise
        return self.labels.get(label, label)

    def over(self, defaults: Mapping[str, object], source: str) -> "ImportMap":
        """This map, with a file's own `defaults` where the map has no value."""
        time, segments, task = (defaults.get(key) for key in ("time", "segments", "task"))
        return replace(
            self,
            time=_time(time, f"{source}: time")
            if time is not None and self.time is None
            else self.time,
            segments=_segments(segments, "segments") if self.segments is None else self.segments,
            task=_text(task, "task") if task is not None and self.task is None else self.task,
        )


def load_map(path: str | Path) -> ImportMap:
    """Read the map of an import, a YAML file as described in docs/import.md.

    Raises:
        DofError: names file, entry and key, if the file is missing, not YAML or malformed.
    """
    source = Path(path)
    try:
        content = load_yaml(read_text(source))
    except OSError as error:
        cure = f"Check the path. {EXAMPLES}"
        raise DofError.about(str(source), "a map in YAML", error, cure) from error
    except UntrustedError as error:
        raise _error(str(source), "a map in YAML", error) from error
    return ImportMap.from_dict(content, str(source))


def _mapping(value: object, place: str, keys: Sequence[str] = ()) -> Mapping:
    if not isinstance(value, Mapping):
        expected = f"a mapping with keys among {', '.join(keys)}" if keys else "a mapping"
        raise _error(place, expected, value)
    if keys and (unknown := sorted(set(map(str, value)) - set(keys))):
        raise _error(place, f"only the keys {', '.join(keys)}", ", ".join(unknown))
    return value


def _columns(item: Mapping, entry: DofEntry, files: Mapping[str, str], place: str) -> ColumnsOf:
    names = item.get("columns")
    if isinstance(names, str | int):
        names = [names]
    count = len(entry.message_names)
    # an orientation with a reference may be given as a rotation vector, as it is exported
    counts = {count, len(entry.names) if entry.reference else count}
    if names is not None and (
        not isinstance(names, list)
        or len(names) not in counts
        or any(n in ("", None) for n in names)
    ):
        raise _error(f"{place}: columns", f"{count} names, one for each field or joint", names)
    axes = [found[1].lower() for name in names or () if (found := AXIS.search(str(name)))]
    if entry.orientation and axes != [*"xyzw"] and sorted(axes) == [*"wxyz"]:
        raise _error(f"{place}: columns", "those of x, y, z and w in this order", names)
    unit, file = str(item.get("columns_unit", "")), str(item.get("file", ""))
    if unit:
        check_convertible(unit, entry.unit, f"{place}: columns_unit")
    if files and "" not in files and file not in files:
        raise _error(f"{place}: file", f"one of {', '.join(files)}", file or "nothing")
    if file and file not in files:
        raise _error(f"{place}: file", "a name under files", file)
    time = _time(item["time"], f"{place}: time") if "time" in item else None
    return ColumnsOf(entry, tuple(map(str, names or ())), unit, file, time)


def _is_context(item: object) -> bool:
    return isinstance(item, Mapping) and item.get("context") is True


def _entries(dofs: DofSpec, side: str) -> tuple[DofEntry, ...]:
    """Entries of a side; those of the context come last among the observed entries."""
    return (*dofs.observed, *dofs.context) if side == "observed" else getattr(dofs, side)


def _files(value: object, place: str) -> dict[str, str]:
    patterns = {"": value} if isinstance(value, str) else dict(_mapping(value, place))
    fields = {frozenset(PLACEHOLDER.findall(str(pattern))) for pattern in patterns.values()}
    if len(fields) > 1 or (len(patterns) == 1 and frozenset() in fields):
        expected = "patterns that all have the same placeholders, such as baton_{number}.csv"
        raise _error(place, expected, ", ".join(map(str, patterns.values())))
    return {str(name): str(pattern) for name, pattern in patterns.items()}


def _time(value: object, place: str) -> TimeSource:
    items = _mapping(value, place, ("column", "unit", "rate", "since", "nanoseconds"))
    unit = str(items.get("unit", ""))
    if "unit" in items and unit not in (*PER_UNIT, SAMPLES):
        raise _error(f"{place}: unit", f"one of {', '.join(PER_UNIT)}, {SAMPLES}", unit)
    if unit == SAMPLES and not {"column", "rate"} <= set(items):
        raise _error(place, f"column and rate with unit: {SAMPLES}", ", ".join(items))
    if unit != SAMPLES and ("column" in items) == ("rate" in items):
        raise _error(place, "either column or rate", "both" if "rate" in items else "neither")
    rate = _number(items.get("rate", 1.0), f"{place}: rate")
    if rate < 1e-6:  # a sample in twelve days
        raise _error(f"{place}: rate", "samples a second, at least 1e-06", rate)
    since = items.get("since")
    since_ns = None
    if since is not None:
        since_ns = round(_number(since, f"{place}: since") * NANOSECONDS)
        if isinstance(since, int):  # keeps nanoseconds, which a float would lose
            since_ns = since * NANOSECONDS
    column = str(items["column"]) if "column" in items else None
    return TimeSource(column, unit, rate, since_ns, str(items.get("nanoseconds", "")))


def _segments(value: object, place: str) -> str | tuple[Cut, ...] | None:
    if value is None:
        return None
    if isinstance(value, Mapping) and "column" in _mapping(value, place, ("column",)):
        return str(value["column"])
    if not isinstance(value, list) or not value:
        raise _error(place, "a column, or a list of start and end", value)
    cuts = []
    for k, one in enumerate(value):
        here = f"{place}[{k}]"
        items = _mapping(one, here, ("start", "end", "task", "file"))
        start, end = (_number(items.get(key), f"{here}: {key}") for key in ("start", "end"))
        if not start < end:
            raise _error(here, "a start before the end", f"{start} and {end}")
        cuts.append(Cut(start, end, str(items.get("task", "")), str(items.get("file", ""))))
    return tuple(cuts)


def _text(value: object, place: str) -> Text:
    if isinstance(value, Mapping):
        return Text(str(_mapping(value, place, ("column",)).get("column", "")), "")
    if not isinstance(value, (str, int, float)):
        raise _error(place, "a text, or a mapping with the key column", value)
    return Text("", str(value))


def _number(value: object, place: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise _error(place, "a number", "nothing" if value is None else value)
    if not -LARGEST <= value <= LARGEST:
        raise _error(place, f"a number from {-LARGEST:g} to {LARGEST:g}", value)
    return float(value)


def _count(value: object, least: int, place: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or value < least:
        raise _error(place, f"a whole number from {least} on", value)
    return value


def _error(argument: str, expected: str, got: object) -> DofError:
    return DofError.about(argument, expected, got, EXAMPLES)
