# SPDX-License-Identifier: Apache-2.0
"""The demo's table, as cells and as lines of a terminal."""

from collections.abc import Callable, Sequence
from typing import Literal, NamedTuple

from intent_recognition.evaluation import CM_PER_M, InteractionRecord

NOTHING = "-"
BY_FORCE = "handed over"
"""The column that only a session has in which objects are handed over by force."""


class Field(NamedTuple):
    """One column: heading, unit, narrowest width, side, and how a record fills it."""

    title: str
    unit: str
    width: int
    align: Literal["left", "right"]
    cell: Callable[[InteractionRecord], str | None]


def _number(value: float | None, factor: float = 1.0, form: str = ".1f") -> str | None:
    return None if value is None else format(factor * value, form)


FIELDS = (
    Field("#", "", 3, "right", lambda r: str(r.index)),
    Field("true task", "", 16, "left", lambda r: r.task),
    Field("recognised", "", 16, "left", lambda r: r.recognised or None),
    Field("observations", "", 12, "right", lambda r: _number(r.observations, form=".0f")),
    Field("decided", "s", 8, "right", lambda r: _number(r.decision_time_s, form=".2f")),
    Field("share", "%", 6, "right", lambda r: _number(r.decision_share, 100.0, ".0f")),
    Field("movement", "s", 8, "right", lambda r: _number(r.movement_s, form=".2f")),
    Field("hand error", "cm", 10, "right", lambda r: _number(r.hand_error_m, CM_PER_M)),
    Field("arrival", "s", 8, "right", lambda r: _number(r.arrival_s, form="+.2f")),
    Field(BY_FORCE, "s", 11, "right", lambda r: _number(r.transfer_s, form="+.2f")),
    Field("note", "", 0, "left", lambda r: _note(r)),
)
"""decided = after onset; share = of the human's movement; arrival = after the human's end."""


def _note(record: InteractionRecord) -> str:
    began = f"began as {record.changed_from}" if record.changed_from else ""
    missed = "" if record.right else "MISSED"
    kept = "NOT HANDED OVER" if record.handed_over is False else ""
    wrong = "WRONG HELP" if record.wrong_helps else ""
    return " ".join(filter(None, (record.person, missed, wrong, kept, began, record.note)))


def fields_of(records: Sequence[InteractionRecord]) -> tuple[Field, ...]:
    """The columns of a session's table."""
    by_force = any(record.handed_over is not None for record in records)
    return tuple(field for field in FIELDS if by_force or field.title != BY_FORCE)


def cells(record: InteractionRecord, fields: Sequence[Field] = FIELDS) -> tuple[str | None, ...]:
    """One text per field; None where nothing was measured."""
    return tuple(field.cell(record) for field in fields)


def table_lines(records: Sequence[InteractionRecord]) -> list[str]:
    """The whole table as lines of a terminal, with a heading and a rule below it."""
    fields = fields_of(records)
    titles = [f"{f.title} [{f.unit}]" if f.unit else f.title for f in fields]
    rule = "-" * sum(_width(f) + 2 for f in fields[:-1]) + "-" * 4
    rows = ([cell or NOTHING for cell in cells(record, fields)] for record in records)
    return [_line(fields, titles), rule, *(_line(fields, row) for row in rows)]


def _width(field: Field) -> int:
    title = len(field.title) + (len(field.unit) + 3 if field.unit else 0)
    return max(field.width, title)


def _line(fields: Sequence[Field], texts: Sequence[str]) -> str:
    padded = (
        text.ljust(_width(field)) if field.align == "left" else text.rjust(_width(field))
        for field, text in zip(fields, texts, strict=True)
    )
    return "  ".join(padded).rstrip()
