# SPDX-License-Identifier: Apache-2.0
"""Results of the demo: one record per interaction, and a summary beside the paper's results."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from statistics import fmean, median, stdev

CM_PER_M = 100.0
"""Centimetres in a metre."""
MISSES_ALLOWED = 1 / 40
"""Acceptable share of missed interactions: one of the paper's 40 (`PAPER_RECOGNISED`)."""

TASKS_APART = frozenset({"screw_handover"})
"""Tasks in which the hand's goal does not depend on the human: their hand error does not measure
prediction and is left out of the overall one."""
FIXED_PLACE = "not in the overall hand error: its place is fixed"
"""Remark on these tasks."""

CONDITIONS = (
    "Conditions differ: the paper's hand errors are forward kinematics of trajectories predicted "
    "in leave-one-out cross-validation (Ewerton et al. 2015, Sec. IV-B), with a real arm and a "
    "person's demonstrations; ours are measured on the moving simulated arm, against the place "
    "the demonstrator's rule gives for the simulated coworker's goal."
)


@dataclass(frozen=True)
class HandError:
    """Distance between the hand and its correct place over n interactions, in cm."""

    n: int  # number of interactions measured
    mean_cm: float | None  # mean; None when n is 0
    two_std_cm: float | None  # two sample standard deviations; None when n is below 2

    def __str__(self) -> str:
        """Text such as `3.2 +- 2.6 cm`, `3.2 cm` for one interaction, `- cm` for none."""
        if self.mean_cm is None:
            return "- cm"
        spread = "" if self.two_std_cm is None else f" +- {self.two_std_cm:.1f}"
        return f"{self.mean_cm:.1f}{spread} cm"


PAPER_RECOGNISED = (40, 40)
"""Number of recognised interactions and of all (Ewerton et al. 2015, Sec. IV-B)."""
PAPER_HAND_ERROR: Mapping[str, HandError] = {
    "plate_handover": HandError(15, 3.2, 2.6),
    "hold_screwdriver": HandError(13, 2.1, 2.3),
}
"""Hand errors of Ewerton et al. 2015, Sec. IV-B; n is their number of training demonstrations."""


@dataclass(frozen=True)
class InteractionRecord:
    """Results of one interaction."""

    index: int  # number in the session, from 1
    task: str
    # first decision; for a changed movement, the task active soon after its end. Empty or "none"
    # if there was none.
    recognised: str
    observations: int | None  # number of observations from onset to the decision
    decision_time_s: float | None  # time from onset to the decision
    # share of the human's movement that had passed at the decision; 1 = its end
    decision_share: float | None
    # distance of the hand from the place given by the demonstrator's rule; None if not recognised
    hand_error_m: float | None
    # arrival of the robot after the end of the human's movement; negative = before it
    arrival_s: float | None
    movement_s: float
    note: str = ""
    # the task with which a movement started that the human then changed to `task`; empty without
    # a change
    changed_from: str = ""
    # whether the object changed hands without being dropped; None if objects are not handed over
    # by force
    handed_over: bool | None = None
    transfer_s: float | None = None  # time of the change of hands after the movement
    largest_force_n: float | None = None  # largest force of the person on the object
    # most probable task at the end of the movement, whether or not the arm acted
    believed: str = ""
    person: str = ""  # name of the person; empty for a single one
    # number of times, up to the next interaction, that the arm began to help while the person
    # neither moved nor waited
    wrong_helps: int = 0

    @property
    def right(self) -> bool:
        """Whether the human's task was recognised."""
        return self.recognised == self.task

    @property
    def before_end(self) -> bool:
        """Whether the task was recognised before the end of the human's movement.

        With several people, who wait for one arm: whether it was the most probable then.
        """
        if self.person:
            return self.believed == self.task
        return self.right and self.decision_share is not None and self.decision_share < 1.0


@dataclass(frozen=True)
class PersonSummary:
    """Results of one of several people."""

    person: str
    n: int  # number of interactions
    recognised: int  # number in which the task was most probable at the movement's end
    helped: int  # number in which the arm did that task for this person
    handed_over: int  # number in which the object changed hands
    wrong_helps: int  # times the arm began to help while the person neither moved nor waited
    median_arrival_s: float | None  # after the movement's end; None if the arm never came
    largest_force_n: float | None  # largest force on an object; None without any


@dataclass(frozen=True)
class DemoSummary:
    """Results of a session; interactions that the human changed midway are counted separately."""

    n: int  # unchanged interactions, to which all fields before `n_changed` refer
    recognised_right: int  # number recognised
    decided_before_end: int  # number recognised before the end of the human's movement
    # over recognised interactions; None without any, or with several people, who wait for one arm
    median_decision_share: float | None
    # over all tasks in which the place depends on the human
    hand_error: HandError
    hand_error_by_task: Mapping[str, HandError]  # by task, including `tasks_apart`
    tasks_apart: tuple[str, ...]  # tasks left out of `hand_error`
    # median_arrival_s, latest_arrival_s: after the movement, over all arrivals
    median_arrival_s: float | None
    latest_arrival_s: float | None
    n_changed: int  # number of changed interactions
    changes_followed: int  # number whose new task was active soon after the movement's end
    changed_hand_error: HandError  # over changed interactions, as `hand_error`
    n_transfers: int = 0  # number of all interactions with a handover by force
    handed_over: int = 0  # number in which the object was handed over
    largest_force_n: float | None = None  # largest force of a person on an object; None without any
    people: tuple[PersonSummary, ...] = ()  # results of each of several people; empty for one

    @property
    def missed(self) -> int:
        """Number of interactions not recognised, or recognised as another task."""
        return self.n - self.recognised_right

    @property
    def too_many_missed(self) -> bool:
        """Whether more than one in forty was missed or not handed over; the demo then returns 1."""
        allowed = MISSES_ALLOWED * (self.n + self.n_changed)
        not_handed_over = self.n_transfers - self.handed_over
        return self.missed > MISSES_ALLOWED * self.n or not_handed_over > allowed


def hand_error(errors_m: Sequence[float]) -> HandError:
    """Mean and two sample standard deviations, in cm, of distances in m."""
    errors_cm = [CM_PER_M * error for error in errors_m]
    mean = fmean(errors_cm) if errors_cm else None
    return HandError(len(errors_cm), mean, 2 * stdev(errors_cm) if len(errors_cm) > 1 else None)


def summarise(records: Sequence[InteractionRecord]) -> DemoSummary:
    """Summarise records; hand errors of `TASKS_APART` are left out of the overall hand error."""
    people = tuple(
        _summary_of(person, [r for r in records if r.person == person])
        for person in sorted({r.person for r in records} - {""})
    )
    changed = [record for record in records if record.changed_from]
    transfers = [record for record in records if record.handed_over is not None]
    forces = _known(transfers, "largest_force_n")
    moved = [record for record in changed if record.task not in TASKS_APART]
    records = [record for record in records if not record.changed_from]
    tasks = sorted({record.task for record in records})
    by_task = {t: _known([r for r in records if r.task == t], "hand_error_m") for t in tasks}
    apart = tuple(task for task in by_task if task in TASKS_APART)
    right = [r for r in records if r.right and not r.person]
    shares, arrivals = _known(right, "decision_share"), _known(records, "arrival_s")
    return DemoSummary(
        n=len(records),
        recognised_right=sum(record.right for record in records),
        decided_before_end=sum(record.before_end for record in records),
        median_decision_share=median(shares) if shares else None,
        hand_error=hand_error([e for t, es in by_task.items() if t not in apart for e in es]),
        hand_error_by_task={task: hand_error(errors) for task, errors in by_task.items()},
        tasks_apart=apart,
        median_arrival_s=median(arrivals) if arrivals else None,
        latest_arrival_s=max(arrivals) if arrivals else None,
        n_changed=len(changed),
        changes_followed=sum(record.right for record in changed),
        changed_hand_error=hand_error(_known(moved, "hand_error_m")),
        n_transfers=len(transfers),
        handed_over=sum(bool(record.handed_over) for record in transfers),
        largest_force_n=max(forces) if forces else None,
        people=people,
    )


def _known(records: Sequence[InteractionRecord], name: str) -> list[float]:
    return [value for one in records if (value := getattr(one, name)) is not None]


def _summary_of(person: str, records: Sequence[InteractionRecord]) -> PersonSummary:
    arrivals, forces = _known(records, "arrival_s"), _known(records, "largest_force_n")
    return PersonSummary(
        person,
        n=len(records),
        recognised=sum(r.believed == r.task for r in records),
        helped=sum(r.right for r in records),
        handed_over=sum(bool(r.handed_over) for r in records),
        wrong_helps=sum(r.wrong_helps for r in records),
        median_arrival_s=median(arrivals) if arrivals else None,
        largest_force_n=max(forces) if forces else None,
    )


def summary_line(summary: DemoSummary) -> str:
    """The demo's last line; +- is two standard deviations, the paper's values are in brackets."""
    helped, known = ("helped", "recognised") if summary.people else ("recognised", "decided")
    parts = [
        f"{helped} {summary.recognised_right}/{summary.n}",
        f"{known} before the end {summary.decided_before_end}/{summary.n}",
        f"hand error {summary.hand_error}",
    ]
    for task, error in summary.hand_error_by_task.items():
        remarks = []
        if task in PAPER_HAND_ERROR:
            remarks.append(f"paper {PAPER_HAND_ERROR[task]}")
        if task in summary.tasks_apart:
            remarks.append(FIXED_PLACE)
        parts.append(f"{task} {error}" + (f" ({'; '.join(remarks)})" if remarks else ""))
    if summary.median_decision_share is not None:
        parts.append(f"median decision at {100 * summary.median_decision_share:.0f} %")
    if summary.median_arrival_s is not None:
        parts.append(f"median arrival {summary.median_arrival_s:+.2f} s after the human")
    if summary.n_changed:
        followed = f"{summary.changes_followed}/{summary.n_changed}"
        parts.append(f"changes followed {followed} with hand error {summary.changed_hand_error}")
    if summary.n_transfers:
        force = f" with at most {summary.largest_force_n or 0.0:.1f} N"
        parts.append(f"handed over {summary.handed_over}/{summary.n_transfers}{force}")
    for one in summary.people:
        helped = f"recognised {one.recognised}/{one.n}, helped {one.helped}/{one.n}"
        parts.append(f"{one.person} {helped}, wrong helps {one.wrong_helps}")
    return "summary: " + ", ".join(parts)


def to_json(
    records: Sequence[InteractionRecord], summary: DemoSummary, settings: Mapping | None = None
) -> dict:
    """All results as plain values for `json.dump`; records are in m, the summary is in cm."""
    return {
        "summary": asdict(summary)
        | {
            "missed": summary.missed,
            "too_many_missed": summary.too_many_missed,
            "line": summary_line(summary),
        },
        "paper": {
            "recognised": list(PAPER_RECOGNISED),
            "hand_error_by_task": {t: asdict(e) for t, e in PAPER_HAND_ERROR.items()},
            "source": "Ewerton et al. 2015, Sec. IV-B",
            "conditions": CONDITIONS,
        },
        "interactions": [asdict(record) | {"right": record.right} for record in records],
        "settings": dict(settings or {}),
    }
