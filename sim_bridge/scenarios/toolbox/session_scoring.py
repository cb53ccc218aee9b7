# SPDX-License-Identifier: Apache-2.0
"""Score a toolbox session: compare logged topics with what the coworker did."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.evaluation import ContactLog, InteractionRecord, SessionLog, Trace
from intent_recognition.kinematics import JOINT_NAMES, hand_position
from intent_recognition.promp import NONE
from sim_bridge.coworker import Interaction, SessionPlan
from sim_bridge.scenarios.toolbox.scene import HOME_HAND_M, handover_point
from sim_bridge.scenarios.toolbox.transfer_scoring import score_transfer, transfer_trace

DECIDED_WITHIN_S = 0.3
"""Time after the movement's end within which a change of mind must have been followed [s]."""
EARLIEST_DECISION_S = 0.1
"""A decision may precede the onset of its movement by at most this [s]."""
REST_SPEED_RAD_S, AWAY_FROM_HOME_M = 0.03, 0.08
"""Speed of the fastest joint below which the arm rests [rad/s], and distance of the hand from home
and from stands above which a rest counts as an arrival [m]."""


def first_sample_ns(log: SessionLog, plan: SessionPlan) -> int | None:
    """Stamp of the session's first sample, from a logged position that occurs once in the plan.

    The first messages may be lost; samples are stamped at multiples of 10 ms after the first.
    """
    for stamp, position in zip(log.wrist_ns[:50], log.wrist_m[:50], strict=False):
        found = np.flatnonzero(np.all(plan.samples.positions_m == position, axis=1))
        if found.size == 1:
            return int(stamp) - round(float(plan.samples.times_s[found[0]]) * 1e9)
    return None


def lwr_hand(q: Floats) -> Floats:
    """Positions of the LWR's hand (..., 3) [m] for measured joints, fingers last."""
    return hand_position(q[..., : len(JOINT_NAMES)])


HandOf = Callable[[Floats], Floats]
"""Function from measured joints (..., n) to the hand's position in the world (..., 3) [m]."""


class Scoring(NamedTuple):
    """Reference values for scoring an arm."""

    places_m: Floats  # right position of the hand in each interaction (n, 3), world
    hand_of: HandOf = lwr_hand
    home_m: Floats = HOME_HAND_M  # position where the hand waits (3,)
    by_force: bool = False  # whether objects are handed over by force
    # positions where the hand may rest on the way, such as stands (k, 3)
    passed_m: Floats = np.empty((0, 3))


def toolbox_places(plan: SessionPlan) -> Floats:
    """Position of the hand in each interaction by the demonstrator's rule (n, 3) [m]."""
    return np.array([handover_point(one.task, one.goal_m) for one in plan.interactions])


def score_session(
    log: SessionLog, plan: SessionPlan, first_ns: int, scoring: Scoring
) -> tuple[list[InteractionRecord], list[Trace]]:
    """One record and one trace (arrays for the report's figures) per interaction."""
    onsets = [first_ns + round(i.onset_s * 1e9) for i in plan.interactions]
    limits = [onset - round(EARLIEST_DECISION_S * 1e9) for onset in onsets[1:]]
    limits.append(np.iinfo(np.int64).max)
    records, traces = [], []
    for number, (interaction, until) in enumerate(zip(plan.interactions, limits, strict=True), 1):
        record, trace = score_interaction(log, interaction, first_ns, until, number, scoring)
        records.append(record)
        traces.append(trace)
    return records, traces


def score_interaction(
    log: SessionLog,
    interaction: Interaction,
    first_ns: int,
    until_ns: int,
    number: int,
    scoring: Scoring,
) -> tuple[InteractionRecord, Trace]:
    """Score one interaction as in `score_session`; `until_ns` ends the search for decisions."""
    onset = first_ns + round(interaction.onset_s * 1e9)
    end = first_ns + round(interaction.end_s * 1e9)
    movement_s = (end - onset) * 1e-9
    earliest = onset - round(EARLIEST_DECISION_S * 1e9)
    if interaction.changed_from:
        decided_ns, recognised, note = _last_decision(log, earliest, end)
    else:
        decided_ns, recognised, note = _decision(log, earliest, until_ns)
    observations = share = decision_s = None
    if decided_ns is not None:
        observations = int(np.sum((log.wrist_ns >= onset) & (log.wrist_ns <= decided_ns)))
        decision_s = (decided_ns - onset) * 1e-9
        share = decision_s / movement_s
    error = arrival = None
    transfer = score_transfer(_contacts_of(log, interaction.task), onset, until_ns)
    at_ns = None if transfer is None else transfer.at_ns
    if decided_ns is not None and recognised == interaction.task:
        arrival = _arrival(log, decided_ns, end, until_ns, scoring, at_ns)
        late_s = 1.0  # after the end of the movement
        if scoring.by_force and arrival is not None:  # the arm may have helped another person first
            late_s = max(late_s, arrival)
        scored_ns = end + round(late_s * 1e9)
        error = _hand_error(log, scoring.places_m[number - 1], scored_ns, scoring)
    record = InteractionRecord(
        index=number,
        task=interaction.task,
        recognised=recognised or NONE,
        observations=observations,
        decision_time_s=decision_s,
        decision_share=share,
        hand_error_m=error,
        arrival_s=arrival,
        movement_s=movement_s,
        note=note,
        changed_from=interaction.changed_from,
        handed_over=False if scoring.by_force else None,
        believed=_believed(log, end),
    )
    trace = _trace(log, number, onset, end, decided_ns)
    if transfer is not None:
        record = replace(
            record,
            handed_over=transfer.handed_over and record.right,
            transfer_s=None if at_ns is None else (at_ns - end) * 1e-9,
            largest_force_n=transfer.largest_force_n,
        )
        trace |= transfer_trace(log, onset, end, until_ns, transfer)
    return record, trace


def score_people(
    logs: Mapping[str, SessionLog],
    plans: Mapping[str, SessionPlan],
    first_ns: int,
    scorings: Mapping[str, Scoring],
) -> tuple[list[InteractionRecord], list[Trace]]:
    """Records and traces of all people in order of time; see `score_session` for the arguments.

    All mappings are keyed by person. Help is wrong for a person who neither moves nor waits.
    """
    rows = []
    for person, plan in plans.items():
        records, traces = score_session(logs[person], plan, first_ns, scorings[person])
        wrong = _wrong_helps(logs[person], plan, first_ns) if person else [0] * len(records)
        for one, record, trace, n in zip(plan.interactions, records, traces, wrong, strict=True):
            rows.append((one.onset_s, replace(record, person=person, wrong_helps=n), trace))
    rows.sort(key=lambda row: row[0])
    for index, (_, _, trace) in enumerate(rows, 1):
        trace["index"] = index
    records = [replace(record, index=k) for k, (_, record, _) in enumerate(rows, 1)]
    return records, [trace for *_, trace in rows]


def _wrong_helps(log: SessionLog, plan: SessionPlan, first_ns: int) -> list[int]:
    """Number of times that help began wrongly, from each interaction until the next one."""
    wrong = [0] * len(plan.interactions)
    onsets = np.array([one.onset_s for one in plan.interactions]) - EARLIEST_DECISION_S
    for at_ns, task in zip(log.active_ns.tolist(), log.active, strict=True):
        at_s = (at_ns - first_ns) * 1e-9
        k = int(np.searchsorted(onsets, at_s, side="right")) - 1
        if task and (k < 0 or at_s >= plan.interactions[k].leaves_s):
            wrong[max(k, 0)] += 1
    return wrong


def _contacts_of(log: SessionLog, task: str) -> ContactLog:
    """All contacts, with empty holders where another task is active."""
    rows = np.searchsorted(log.active_ns, log.contacts.stamps_ns, side="right").tolist()
    active = ("", *log.active)
    own = (
        holder if active[row] == task else ""
        for row, holder in zip(rows, log.contacts.holders, strict=True)
    )
    return log.contacts._replace(holders=tuple(own))


def _believed(log: SessionLog, end_ns: int) -> str:
    k = int(np.searchsorted(log.tasks_ns, end_ns, side="right")) - 1
    return "" if k < 0 else log.labels[int(np.argmax(log.probabilities[k]))]


def _decision(log: SessionLog, earliest: int, until: int) -> tuple[int | None, str, str]:
    """Stamp and label of the first task that was activated, and a note on any that followed."""
    changes = [
        (int(stamp), task)
        for stamp, task in zip(log.active_ns, log.active, strict=True)
        if earliest <= stamp < until and task
    ]
    if not changes:
        return None, "", "nothing was activated"
    later = [task for _, task in changes[1:] if task != changes[0][1]]
    return *changes[0], f"then {', '.join(later)}" if later else ""


def _last_decision(log: SessionLog, earliest: int, end_ns: int) -> tuple[int | None, str, str]:
    """Stamp and label of the task that is active `DECIDED_WITHIN_S` after a movement's end."""
    first, last = np.searchsorted(log.active_ns, [earliest, end_ns + round(DECIDED_WITHIN_S * 1e9)])
    if last == first or not log.active[last - 1]:
        return None, "", ""
    return int(log.active_ns[last - 1]), log.active[last - 1], ""


def _hand_error(log: SessionLog, place_m: Floats, at_ns: int, scoring: Scoring) -> float | None:
    """Distance of the measured hand from its right position at a time [m]."""
    index = np.searchsorted(log.joint_ns, at_ns) - 1
    if index < 0:
        return None
    return float(np.linalg.norm(scoring.hand_of(log.joint_rad[index]) - place_m))


def _arrival(
    log: SessionLog,
    decided_ns: int,
    end_ns: int,
    until_ns: int,
    scoring: Scoring,
    transfer_ns: int | None,
) -> float | None:
    """Time from the movement's end until the arm first rests at its goal after the decision [s].

    The arm must have moved before. `transfer_ns` is the stamp at which an object changed hands: the
    hand's position at that time is the goal.
    """
    first, last = np.searchsorted(log.joint_ns, [decided_ns, until_ns])
    stamps, joints = log.joint_ns[first:last], log.joint_rad[first:last]
    if len(stamps) < 20:
        return None
    step = 10
    speed = np.max(np.abs(joints[step:] - joints[:-step]), axis=1)
    speed /= (stamps[step:] - stamps[:-step]) * 1e-9
    hand_m = scoring.hand_of(joints)
    elsewhere_m = np.vstack([scoring.home_m, scoring.passed_m])
    to_these = hand_m[step:, None] - elsewhere_m
    away = np.linalg.norm(to_these, axis=2).min(axis=1)
    late = stamps[step:] > end_ns - 5e8
    moved = speed > REST_SPEED_RAD_S
    if scoring.by_force:  # it may start where it helped another person
        moved &= np.linalg.norm(hand_m[step:] - hand_m[0], axis=1) > AWAY_FROM_HOME_M
    moved = np.logical_or.accumulate(moved)
    if transfer_ns is not None:
        there_m = hand_m[max(int(np.searchsorted(stamps, transfer_ns)) - 1, 0)]
        late &= np.linalg.norm(hand_m[step:] - there_m, axis=1) < AWAY_FROM_HOME_M
    rests = (speed < REST_SPEED_RAD_S) & (away > AWAY_FROM_HOME_M) & late & moved
    rested = np.flatnonzero(rests)
    return float((stamps[rested[0]] - end_ns) * 1e-9) if rested.size else None


def _trace(log: SessionLog, number: int, onset: int, end: int, decided: int | None) -> Trace:
    tasks = (log.tasks_ns >= onset) & (log.tasks_ns <= end)
    trace: Trace = {
        "index": number,
        "labels": log.labels,
        "share": (log.tasks_ns[tasks] - onset) / (end - onset),
        "probabilities": log.probabilities[tasks],
        "end_s": (end - onset) * 1e-9,
    }
    if decided is not None:
        trace["decision_s"] = (decided - onset) * 1e-9
    return trace
