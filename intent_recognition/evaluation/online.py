# SPDX-License-Identifier: Apache-2.0
"""Simulates what the nodes would have done during a recording: onset, filter and decision."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from intent_recognition.evaluation.folds import Fold, merge_folds, of_learned_tasks
from intent_recognition.evaluation.replaying import Decided, decisions
from intent_recognition.evaluation.scoring import PHASES
from intent_recognition.evaluation.unknown_movements import recognised
from intent_recognition.learning import TrainingSettings, cut_to_movement, learn_with_report
from intent_recognition.promp import TaskLibrary
from intent_recognition.recognition import (
    DecisionSettings,
    Estimate,
    IntentEstimator,
    decision_settings,
)
from intent_recognition.signals import Demonstration, common_span, merge


class OnlineOutcome(NamedTuple):
    """The decisions during one recording."""

    task: str  # true task
    # first task that met all conditions of the decision except a certain end; empty if none did
    recognised: str
    activated: tuple[str, ...]  # all tasks that became active, in order
    # share of the movement at which the true task became active; NaN if it never did
    decided_share: float


def run_online(
    library: TaskLibrary,
    recorded: Demonstration,
    settings: DecisionSettings | None = None,
    *,
    phase_known: bool = False,
) -> OnlineOutcome:
    """Feed a recording to the estimator and the decision, as the nodes do.

    Args:
        library: the learned tasks.
        recorded: a recording, fed from its beginning to the end of its movement, so that the
            estimator has to find the onset.
        settings: settings of the decision; None: the node's defaults.
        phase_known: give the estimator the movement's start and duration.
    """
    settings = settings or decision_settings(library)
    followed = [*follow_online(library, recorded, settings, phase_known=phase_known)]
    first = next(filter(None, (recognised(settings, one.state) for one in followed)), "")
    activated, decided_s = actions(recorded, followed)
    return OnlineOutcome(str(recorded.task), first, activated, decided_s / recorded.duration_s)


def actions(recorded: Demonstration, followed: Iterable[Decided]) -> tuple[tuple[str, ...], float]:
    """All tasks that became active, in order, and the time at which the true task did.

    The time is counted from the movement's start [s]; NaN if the true task never became active.
    """
    began = [(one.state.active, one.estimate.stamp_ns) for one in followed if one.state.acts]
    decided_ns = (stamp_ns for task, stamp_ns in began if task == recorded.task)
    decided_s = (next(decided_ns, np.nan) - recorded.start_ns) * 1e-9
    return tuple(task for task, _ in began), decided_s


def follow_online(
    library: TaskLibrary,
    recorded: Demonstration,
    settings: DecisionSettings,
    *,
    phase_known: bool = False,
) -> Iterator[Decided]:
    """Estimate and decision after each observation; the arguments are those of `run_online`."""
    estimator = _phase_aware(library, recorded) if phase_known else IntentEstimator(library)
    return decisions(estimator, settings, _estimates(estimator, recorded, phase_known))


def _estimates(
    estimator: IntentEstimator, recorded: Demonstration, phase_known: bool
) -> Iterator[Estimate]:
    """Yield an estimate per observation up to the end of the movement, from recording or onset."""
    n_agents = len(recorded.observed) + len(recorded.controlled)
    for observation in merge([*recorded.observed, *recorded.controlled, *recorded.context]):
        if observation.stamp_ns > recorded.end_ns:
            break
        if observation.group >= n_agents:
            group, stamp_ns = observation.group - n_agents, max(observation.stamp_ns, 1)
            estimator.update_context(observation._replace(group=group, stamp_ns=stamp_ns))
            continue
        if phase_known and observation.stamp_ns < recorded.start_ns:
            continue
        controlled = observation.group - len(recorded.observed)
        if controlled >= 0:
            estimator.update_controlled(observation._replace(group=controlled))
            continue
        yield estimator.update(observation)


def score_online(
    demonstrations: Sequence[Demonstration],
    folds: Sequence[Fold],
    settings: TrainingSettings,
    progress: Callable[[int], None] = lambda done: None,
) -> dict[str, dict[str, float | None]]:
    """What the nodes would have done, by kind of phase; see `summarise_online`.

    The models are those of `intent train`, learned from movements whatever the settings say. To
    bound the time, folds are merged to at most ten; they test only tasks that they learn.
    `progress` is called with the number of recordings fed so far.
    """
    settings = replace(settings, segmentation="recording")
    movements = [where_both_were_recorded(recorded) for recorded in cut_to_movement(demonstrations)]
    outcomes: dict[str, list[OnlineOutcome]] = {phase: [] for phase in PHASES}
    done = 0
    for train, test in of_learned_tasks(merge_folds(folds, 10), movements):
        library = learn_with_report([movements[i] for i in train], settings).library
        for recorded in (movements[i] for i in test):
            for phase in PHASES:
                known = phase == "known_phase"
                outcomes[phase].append(run_online(library, recorded, phase_known=known))
            done += 1
            progress(done)
    return {phase: summarise_online(found) for phase, found in outcomes.items()}


def where_both_were_recorded(recorded: Demonstration) -> Demonstration:
    """The recording, cut to the span in which both agents were recorded."""
    start_ns, end_ns = common_span(recorded)
    return replace(recorded, start_ns=start_ns, end_ns=end_ns)


def _phase_aware(library: TaskLibrary, recorded: Demonstration) -> IntentEstimator:
    """An estimator that knows start and duration of the movement."""
    log_duration = np.log(recorded.duration_s)
    sure_std = 1e-6
    sure = np.full(library.n_tasks, sure_std)
    # any speed counts as motion
    informed = replace(
        library,
        log_duration_mean=np.full(library.n_tasks, log_duration),
        log_duration_std=sure,
        usual_log_duration=np.log(library.usual_s),
        none_log_duration=np.array([log_duration, sure_std]),
        onset=tuple(replace(own, reference_speed=1e-9) for own in library.onset),
    )
    return IntentEstimator(informed, n_scales=1)


def summarise_online(outcomes: Sequence[OnlineOutcome]) -> dict[str, float | None]:
    """Shares of the `n` recordings, and the median share of the movement at the decision.

    `recognised`: the first recognised task was the true one; `acted_on`: the true one became
    active; `wrongly_acted_on`: another task became active at any time.
    """
    shares = [o.decided_share for o in outcomes if not np.isnan(o.decided_share)]
    n = max(len(outcomes), 1)
    return {
        "n": len(outcomes),
        "recognised": sum(o.recognised == o.task for o in outcomes) / n,
        "acted_on": sum(o.task in o.activated for o in outcomes) / n,
        "wrongly_acted_on": sum(bool({*o.activated} - {o.task}) for o in outcomes) / n,
        "median_share_at_decision": float(np.median(shares)) if shares else None,
    }
