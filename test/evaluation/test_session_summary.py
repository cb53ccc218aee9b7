# SPDX-License-Identifier: Apache-2.0
"""The demo's summary: identities over any records, and the form of its last line."""

from dataclasses import replace
from io import StringIO

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rich.console import Console

from intent_recognition.cli.demo import table_of
from intent_recognition.evaluation import HandError, InteractionRecord
from intent_recognition.evaluation.session_summary import hand_error, summarise, summary_line
from intent_recognition.report.demo_report import FIELDS, fields_of

RELAXED = settings(deadline=None, max_examples=40, suppress_health_check=[HealthCheck.too_slow])
PLATE, HOLD, SCREW = "plate_handover", "hold_screwdriver", "screw_handover"


def record(index=1, task=PLATE, **changes) -> InteractionRecord:
    values = {
        "recognised": task,
        "observations": 42,
        "decision_time_s": 0.42,
        "decision_share": 0.3,
        "hand_error_m": 0.02,
        "arrival_s": 0.25,
        "movement_s": 1.4,
    }
    return InteractionRecord(index, task, **{**values, **changes})


def missed(index=1, task=PLATE, recognised="none") -> InteractionRecord:
    nothing = dict.fromkeys(
        ("observations", "decision_time_s", "decision_share", "hand_error_m", "arrival_s")
    )
    return record(index, task, recognised=recognised, **nothing)


@RELAXED
@given(st.lists(st.floats(0.0, 1.0), min_size=2, max_size=40))
def test_hand_error_equals_numpy(errors_m):
    found = hand_error(errors_m)
    assert found.mean_cm == pytest.approx(100 * np.mean(errors_m), abs=1e-9)
    assert found.two_std_cm == pytest.approx(200 * np.std(errors_m, ddof=1), abs=1e-6)


def test_the_line_says_the_numbers_and_the_papers():
    records = [
        record(1, PLATE, hand_error_m=0.02),
        record(2, HOLD, hand_error_m=0.04, decision_share=0.6),
        record(3, SCREW, hand_error_m=0.5, arrival_s=-0.1),
        missed(4, PLATE),
    ]
    summary = summarise(records)
    line = summary_line(summary)
    assert line.startswith(
        "summary: recognised 3/4, decided before the end 3/4, hand error 3.0 +- 2.8 cm, "
    )
    assert "hold_screwdriver 4.0 cm (paper 2.1 +- 2.3 cm)" in line
    assert "plate_handover 2.0 cm (paper 3.2 +- 2.6 cm)" in line
    assert "screw_handover 50.0 cm (not in the overall hand error" in line
    assert "median decision at 30 %" in line
    assert summary.too_many_missed


def test_one_miss_in_forty_is_allowed_and_a_wrong_or_late_task_is_one():
    right = [record(i) for i in range(1, 40)]
    assert not summarise([*right, missed(40)]).too_many_missed
    assert summarise([*right[:-1], missed(39), missed(40)]).too_many_missed
    assert summarise([*right[:4], missed(5)]).too_many_missed
    assert not summarise([]).too_many_missed
    summary = summarise([replace(missed(1, PLATE), recognised=HOLD, decision_share=0.2)])
    assert (summary.recognised_right, summary.decided_before_end) == (0, 0)
    assert summary.median_decision_share is None
    assert not record(decision_share=1.0).before_end
    assert record(decision_share=np.nextafter(1.0, 0.0)).before_end


def test_changes_of_mind_stand_apart():
    unchanged = [record(1, PLATE), record(2, HOLD)]
    changed = [
        replace(record(3, PLATE, hand_error_m=0.05), changed_from=HOLD),
        replace(missed(4, HOLD, PLATE), changed_from=PLATE),
        replace(record(5, SCREW, hand_error_m=0.5), changed_from=PLATE),
    ]
    summary = summarise([*unchanged, *changed])
    alone = summarise(unchanged)
    assert replace(summary, n_changed=0, changes_followed=0, changed_hand_error=hand_error([])) == (
        alone
    )
    assert (summary.n_changed, summary.changes_followed) == (3, 2)
    assert summary.changed_hand_error == HandError(1, 5.0, None)
    assert summary_line(summary).startswith(summary_line(alone))
    assert summary_line(summary).endswith("changes followed 2/3 with hand error 5.0 cm")
    notes = [fields_of(changed)[-1].cell(record) for record in changed]
    assert notes[0] == "began as hold_screwdriver"
    assert notes[1].startswith("MISSED began as plate_handover")


def test_who_waits_for_the_one_arm_was_recognised_all_the_same():
    """Of several people the decision to act says when the arm was free, not what was known."""
    waits = record(1, HOLD, person="anna", believed=HOLD, decision_share=2.4)
    doubted = record(2, PLATE, person="ben", believed=HOLD, decision_share=0.9)
    summary = summarise([waits, doubted])
    assert (summary.recognised_right, summary.decided_before_end) == (2, 1)
    assert summary.median_decision_share is None
    line = summary_line(summary)
    assert line.startswith("summary: helped 2/2, recognised before the end 1/2, ")
    assert "anna recognised 1/1, helped 1/1" in line and "ben recognised 0/1" in line


def test_the_table_shows_the_numbers():
    one = record(3, HOLD, note="hesitated")
    texts = {field.title: field.cell(one) for field in FIELDS}
    assert texts == {
        "#": "3",
        "true task": "hold screwdriver",
        "recognised": "hold screwdriver",
        "observations": "42",
        "decided": "0.42",
        "share": "30",
        "movement": "1.40",
        "hand error": "2.0",
        "arrival": "+0.25",
        "handed over": None,
        "note": "hesitated",
    }
    assert "handed over" not in {field.title for field in fields_of([one])}
    by_force = replace(one, handed_over=True, transfer_s=0.5)
    assert [f.cell(by_force) for f in fields_of([by_force])][-2:] == ["+0.50", "hesitated"]


@pytest.mark.parametrize("width", [80, 120])
def test_the_terminals_table_fits_and_cuts_no_word(width):
    records = [record(k, task, transfer_s=0.5) for k, task in enumerate((HOLD, PLATE), 1)]
    for notes in ("", "hesitated before the reach"):
        shown = [replace(one, note=notes) for one in records]
        console = Console(width=width, file=StringIO(), markup=False)
        console.print(table_of(shown))
        lines = console.file.getvalue().splitlines()
        assert max(map(len, lines)) <= width and "\N{HORIZONTAL ELLIPSIS}" not in "".join(lines)
        words = {word for line in lines for word in line.split()}
        assert {"screwdriver", "recognised", "[cm]", "+0.50", *notes.split()} <= words
        assert notes or len(lines) == 3 + len(shown)
