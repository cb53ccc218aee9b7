# SPDX-License-Identifier: Apache-2.0
"""Report of the changes of mind: measured figures beside wanted ones, and the table."""

import numpy as np

from experiments.change_of_mind.study import (
    BLENDS,
    RELEASED_WITHIN_S,
    SHARES,
    Cell,
    ChangeStudy,
    GoalChange,
)
from experiments.results import Finding
from intent_recognition.report import Block, Column, TableBlock
from sim_bridge.coworker import USUAL_BLEND

NEW_WANTED = {0.15: 0.85, 0.25: 0.85, 0.4: 0.70}
"""Least share of changed reaches with the new task active at the end, by moment of the change."""
OLD_WANTED = {0.15: 0.05, 0.25: 0.05, 0.4: 0.10, 0.6: 0.20}
"""Largest share with the old task kept."""
RELEASED_WANTED, DELAY_WANTED_S = 0.90, 0.9
"""Share let go within `RELEASED_WITHIN_S`; median time to the new task [s]."""
OTHER_BLENDS_WANTED, OTHER_BLENDS_UNTIL = 0.65, 0.25
"""Least share with the new task where changes are quicker or slower, up to that moment."""
LET_GO_WANTED = 2
"""Unchanged reaches of 100 whose task may be withdrawn."""
UNKNOWN_WANTED = 0.03
"""Largest share of reaches to no task in which a task that was never intended is active."""
SESSION_WANTED = 0.95
"""Share of tasks recognised where one movement flows into the next."""
MISSED = "Not reached by the filter as it is."

CONDITIONS = (
    "No paper gives figures of this; what stands in the column of the paper is what is wanted.",
    "Worker and tracker are simulated, and the model has never seen a reach that was changed.",
    "A blended change goes over to the course of a reach that began where the first one did; a"
    " replanned one is minimum jerk from the hand's position, velocity and acceleration.",
    "Decided by the node's own rule with default settings, before 0.3 s after the movement's end.",
)


def findings(study: ChangeStudy) -> tuple[Finding, ...]:
    """What is wanted, and what is measured."""
    usual = {share: study.cell(GoalChange(share, USUAL_BLEND)) for share in SHARES}
    early = study.cell(*(GoalChange(share, USUAL_BLEND) for share in NEW_WANTED))
    others = [
        study.cell(GoalChange(share, blend)).new_active
        for share in SHARES
        for blend in BLENDS
        if blend not in (None, USUAL_BLEND) and share <= OTHER_BLENDS_UNTIL
    ]
    replanned = [f"{study.cell(GoalChange(share, None)).new_active:.0%}" for share in SHARES]
    unknown = study.cell(*(change for change in study.changed if change.to == "unknown"))
    twice = study.cell(*(change for change in study.changed if change.to in ("other", "back")))
    switched = sum(bool(one.others) or one.switches > 0 for one in study.unchanged)
    let_go = sum(one.withdrawals > 0 for one in study.unchanged)
    n = len(study.unchanged)
    recognised = [one for session in study.sessions for one in session.recognised]
    in_order = sum(session.in_order for session in study.sessions)
    return (
        *(
            _at_least(f"new task active, change at {s:.0%}", least, usual[s].new_active, usual[s].n)
            for s, least in NEW_WANTED.items()
        ),
        *(
            _at_most(
                f"old task kept to the end, change at {s:.0%}", most, usual[s].old_kept, usual[s].n
            )
            for s, most in OLD_WANTED.items()
        ),
        _at_least(
            f"old task let go within {RELEASED_WITHIN_S:g} s, where it was active",
            RELEASED_WANTED,
            early.released_in_time,
        ),
        Finding.wanted(
            "median time from the change to the new task's activity [s]",
            f"at most {DELAY_WANTED_S:g}",
            _number(early.delay_s, ".2f"),
            early.delay_s <= DELAY_WANTED_S,
            MISSED,
        ),
        _at_least(
            f"new task active, other blends up to {OTHER_BLENDS_UNTIL:.0%}, the worst",
            OTHER_BLENDS_WANTED,
            min(others),
        ),
        Finding.alone(
            "new task active, replanned at " + ", ".join(f"{share:.0%}" for share in SHARES),
            ", ".join(replanned),
            "Another way to change one's mind than the filter may assume; no figure is wanted.",
        ),
        Finding.wanted(
            "unchanged reaches with another task active",
            "0",
            f"{switched} of {n}",
            not switched,
            MISSED,
        ),
        Finding.wanted(
            "unchanged reaches let go of",
            f"at most {LET_GO_WANTED} of 100",
            f"{let_go} of {n}",
            let_go <= LET_GO_WANTED,
            MISSED,
        ),
        _at_most(
            "reaches that turn to no task in which another task is active",
            UNKNOWN_WANTED,
            unknown.others,
            unknown.n,
            ".1%",
        ),
        Finding.alone(
            "last task active after two changes (15 and 45 %)",
            f"{twice.new_active:.0%} of {twice.n}",
            f"Back to the first task or on to the third; {twice.others:.0%} with a task active"
            " that was never meant.",
        ),
        Finding.alone(
            "error of the predicted hand after a change, median [cm]",
            _number(100.0 * early.hand_error_m, ".1f"),
            "Where the predicted motion ends, where the new task was active; no figure is wanted.",
        ),
        _at_least(
            f"recognised without a pause, {len(study.sessions[0].tasks)} consecutive tasks",
            SESSION_WANTED,
            float(np.mean(recognised)),
            len(recognised),
        ),
        Finding.wanted(
            "sessions without a pause whose tasks became active in order, and no other",
            "all",
            f"{in_order} of {len(study.sessions)}",
            in_order == len(study.sessions),
            MISSED,
        ),
    )


def _at_least(quantity: str, least: float, share: float, of: int | None = None) -> Finding:
    if np.isnan(share):
        return Finding.alone(quantity, "-", "No reach of this run shows it.")
    return Finding.wanted(
        quantity, f"at least {least:.0%}", _share(share, of), share >= least, MISSED
    )


def _at_most(
    quantity: str, most: float, share: float, of: int | None = None, form: str = ".0%"
) -> Finding:
    wanted, shown = f"at most {most:.0%}", _share(share, of, form)
    return Finding.wanted(quantity, wanted, shown, share <= most, MISSED)


def _share(share: float, of: int | None, form: str = ".0%") -> str:
    return _number(share, form) + ("" if of is None else f" of {of}")


def blocks(study: ChangeStudy) -> tuple[Block, ...]:
    """The table of all changes."""
    columns = (
        Column("to", align="left"),
        Column("how", align="left"),
        Column("change at", "%", form=".0f"),
        Column("reaches"),
        Column("new active", "%", form=".0f"),
        Column("old kept", "%", form=".0f"),
        Column(f"let go in {RELEASED_WITHIN_S:g} s", "%"),
        Column("delay", "s"),
        Column("never meant", "%", form=".0f"),
        Column("hand error", "cm"),
    )
    rows = (_row(change, study.cell(change)) for change in study.changed)
    note = (
        "new active, old kept: 0.3 s after the movement's end. let go: of those in which the old"
        " task was active after the change. delay: median, from the change to the new task's"
        " activity. never meant: a task was active that the reach never was. hand error: median."
    )
    return (TableBlock(columns, rows, note),)


def _row(change: GoalChange, cell: Cell) -> tuple[str | float | None, ...]:
    to = {"task": "another task", "unknown": "no task", "other": "a third task", "back": "and back"}
    return (
        to[change.to],
        "replanned" if change.blend is None else f"over {change.blend:.0%}",
        100 * change.share,
        cell.n,
        100 * cell.new_active if change.to != "unknown" else None,
        100 * cell.old_kept,
        _number(100 * cell.released_in_time, ".0f"),
        _number(cell.delay_s, ".2f"),
        100 * cell.others,
        _number(100 * cell.hand_error_m, ".1f"),
    )


def _number(value: float, form: str) -> str:
    return format(value, form) if np.isfinite(value) else "-"
