# SPDX-License-Identifier: Apache-2.0
"""Columns of the demo's table of interactions."""

from collections.abc import Callable, Sequence
from typing import Literal, NamedTuple

from intent_recognition.evaluation import CM_PER_M, InteractionRecord
from intent_recognition.report.drawing import readable


class Field(NamedTuple):
    """One column: heading, unit, alignment, and its text for a record."""

    title: str
    unit: str
    align: Literal["left", "right"]
    cell: Callable[[InteractionRecord], str | None]


def _number(value: float | None, factor: float = 1.0, form: str = ".1f") -> str | None:
    return None if value is None else format(factor * value, form)


FIELDS = (
    Field("#", "", "right", lambda r: str(r.index)),
    Field("true task", "", "left", lambda r: readable(r.task)),
    Field("recognised", "", "left", lambda r: readable(r.recognised)),
    Field("observations", "", "right", lambda r: _number(r.observations, form=".0f")),
    Field("decided", "s", "right", lambda r: _number(r.decision_time_s, form=".2f")),
    Field("share", "%", "right", lambda r: _number(r.decision_share, 100.0, ".0f")),
    Field("movement", "s", "right", lambda r: _number(r.movement_s, form=".2f")),
    Field("hand error", "cm", "right", lambda r: _number(r.hand_error_m, CM_PER_M)),
    Field("arrival", "s", "right", lambda r: _number(r.arrival_s, form="+.2f")),
    Field("handed over", "s", "right", lambda r: _number(r.transfer_s, form="+.2f")),
    Field("note", "", "left", lambda r: _note(r)),
)
"""Columns; "decided" counts from onset, "share" is of the human's movement, "arrival" counts from
its end."""


def _note(record: InteractionRecord) -> str:
    began = f"began as {record.changed_from}" if record.changed_from else ""
    missed = "" if record.right else "MISSED"
    kept = "NOT HANDED OVER" if record.handed_over is False else ""
    wrong = "WRONG HELP" if record.wrong_helps else ""
    return " ".join(filter(None, (record.person, missed, wrong, kept, began, record.note)))


def fields_of(records: Sequence[InteractionRecord]) -> tuple[Field, ...]:
    """Columns of a session's table, without those that are empty for all records."""
    return tuple(field for field in FIELDS if any(map(field.cell, records)))
