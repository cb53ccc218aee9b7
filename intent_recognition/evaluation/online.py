# SPDX-License-Identifier: Apache-2.0
"""What the nodes would have done during a recording: onset, filter and decision."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from intent_recognition.promp import TaskLibrary
from intent_recognition.recognition import (
    DecisionSettings,
    DecisionState,
    IntentEstimator,
    decide,
)
from intent_recognition.signals import Demonstration, merge

SURE_LOG_STD = 1e-6
"""Standard deviation of the logarithm of a duration that is known. Numerical safeguard."""
ALWAYS_MOVING = 1e-9
"""Reference speed below which nothing rests, so that a movement begins with the recording."""


class OnlineOutcome(NamedTuple):
    """The decisions during one recording.

    Attributes:
        task: the true one.
        recognised: the first task that met every condition of the decision but a certain end;
            empty if none did.
        activated: all tasks that became active, in order.
        decided_share: share of the movement passed when the true one became active; NaN if it
            never did.
    """

    task: str
    recognised: str
    activated: tuple[str, ...]
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
        recorded: a recording; its observations are fed up to the end of its movement, from the
            beginning of the recording on, so that the estimator has to find the onset.
        settings: of the decision; the node's defaults when None.
        phase_known: give the movement's start and duration instead.
    """
    settings = settings or DecisionSettings()
    certain_or_not = replace(settings, max_end_std_rad=np.inf, max_end_std_m=np.inf)
    estimator = _told(library, recorded) if phase_known else IntentEstimator(library)
    state = recognising = DecisionState()
    recognised, activated, decided_share = "", list[str](), np.nan
    for observation in merge([*recorded.observed, *recorded.controlled]):
        if observation.stamp_ns > recorded.end_ns:
            break
        if phase_known and observation.stamp_ns < recorded.start_ns:
            continue
        controlled = observation.group - len(recorded.observed)
        if controlled >= 0:
            estimator.update_controlled(observation._replace(group=controlled))
            continue
        estimate = estimator.update(observation)
        current = estimate.labels, estimate.probabilities
        evidence = estimate.log_evidence
        recognising, found = decide(certain_or_not, recognising, *current, None, evidence)
        recognised = recognised or found
        ready = recognising.candidate and recognising.n_for >= settings.n_observations
        needed = ready and state.active != recognising.candidate
        end_std = estimator.predicted_end_std() if needed else None
        state, active = decide(settings, state, *current, end_std, evidence)
        if state.event in ("activated", "switched") and active:
            activated.append(active)
            if active == recorded.task and np.isnan(decided_share):
                passed_ns = observation.stamp_ns - recorded.start_ns
                decided_share = passed_ns / (recorded.end_ns - recorded.start_ns)
    return OnlineOutcome(str(recorded.task), recognised, tuple(activated), decided_share)


def _told(library: TaskLibrary, recorded: Demonstration) -> IntentEstimator:
    """An estimator that knows when the movement begins and how long it lasts."""
    log_duration = np.log(recorded.duration_s)
    sure = np.full(library.n_tasks, SURE_LOG_STD)
    told = replace(
        library,
        log_duration_mean=np.full(library.n_tasks, log_duration),
        log_duration_std=sure,
        none_log_duration=np.array([log_duration, SURE_LOG_STD]),
        onset=tuple(replace(own, reference_speed=ALWAYS_MOVING) for own in library.onset),
    )
    return IntentEstimator(told, n_scales=1)


def summarise_online(outcomes: Sequence[OnlineOutcome]) -> dict[str, float | None]:
    """Shares of the recordings, and the median share of the movement at the decision.

    `recognised`: the first task recognised was the true one; `acted_on`: it became active;
    `wrongly_acted_on`: another became active at any time.
    """
    shares = [o.decided_share for o in outcomes if not np.isnan(o.decided_share)]
    n = max(len(outcomes), 1)
    return {
        "recognised": sum(o.recognised == o.task for o in outcomes) / n,
        "acted_on": sum(o.task in o.activated for o in outcomes) / n,
        "wrongly_acted_on": sum(bool({*o.activated} - {o.task}) for o in outcomes) / n,
        "median_share_at_decision": float(np.median(shares)) if shares else None,
    }
