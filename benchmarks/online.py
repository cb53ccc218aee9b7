# SPDX-License-Identifier: Apache-2.0
"""What one observation, one prediction and one plan cost."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from benchmarks.measure import Result, seconds, seconds_of_both
from benchmarks.textbook import full_state_update
from intent_recognition.kinematics.lwr import LWR_LIMITS
from intent_recognition.kinematics.path import make_path
from intent_recognition.kinematics.plan import Reference
from intent_recognition.kinematics.planning import plan_interaction
from intent_recognition.kinematics.retiming import NominalTiming
from intent_recognition.promp.bank import make_hypotheses, start_bank
from intent_recognition.promp.library import TaskLibrary
from intent_recognition.promp.observations import Observation, merge, observe
from intent_recognition.promp.online import IntentEstimator
from intent_recognition.promp.recognition import task_posterior
from intent_recognition.storage import Demonstration

UPDATES = 100
PERIOD_S = 0.01
PLAN_AFTER_S = 1.0


def online(library: TaskLibrary, recorded: Demonstration) -> Iterator[Result]:
    """All benchmarks of the running nodes' work, on a recording that was not trained on."""
    onset_ns = int(recorded.metadata["human_onset_ns"])
    stream = [o for o in merge(recorded.observed) if o.stamp_ns >= onset_ns][:UPDATES]
    yield from _bank(library, stream, onset_ns)
    estimator = IntentEstimator(library)
    for observation in merge(recorded.observed):
        if observation.stamp_ns > onset_ns + PLAN_AFTER_S * 1e9:
            break
        estimator.observe(observation)
    yield Result(
        "robot's trajectory, 50 points",
        1e3 * seconds(estimator.predict_controlled, 20),
        10.0,
        "at most",
        "ms",
        "published 25 times a second",
    )
    yield _plan(estimator)


def _bank(library: TaskLibrary, stream: list[Observation], onset_ns: int) -> Iterator[Result]:
    hypotheses = make_hypotheses(library)

    def ours() -> None:
        bank = start_bank(library, hypotheses)
        for observation in stream:
            elapsed_s = (observation.stamp_ns - onset_ns) * 1e-9
            bank = observe(library, hypotheses, bank, observation, elapsed_s, PERIOD_S)
            task_posterior(bank, hypotheses, elapsed_s)

    n_tasks = library.n_tasks * hypotheses.n_scales
    few = stream[:2]
    mine_s, textbook_s = seconds_of_both(ours, partial(_textbook, library, few, onset_ns), 3)
    per_update_s = mine_s / len(stream)
    count = len(hypotheses.duration_s)
    yield Result(
        f"one observation, {count} hypotheses, posterior",
        1e3 * per_update_s,
        2.0,
        "at most",
        "ms",
        "a fifth of the period of a 100 Hz tracker",
    )
    ratio = (textbook_s / len(few) / n_tasks) / (per_update_s / count)
    yield Result(
        "... a textbook full-state update takes",
        ratio,
        5.0,
        "at least",
        "x",
        f"per hypothesis; {1e3 * textbook_s / len(few):.1f} ms for {n_tasks}",
    )


def _textbook(library: TaskLibrary, stream: list[Observation], onset_ns: int) -> None:
    """The tasks' hypotheses one after the other, each over the weights of both agents."""
    hypotheses = make_hypotheses(library)
    n_observed, n_dofs = library.n_observed, library.n_observed + library.n_controlled
    dofs = np.arange(n_observed)
    for index in range(library.n_tasks * hypotheses.n_scales):
        mean, covariance = library.primitive(index // hypotheses.n_scales)
        for observation in stream:
            phase = hypotheses.phase((observation.stamp_ns - onset_ns) * 1e-9)[index]
            row = library.basis.design_matrix(np.array([phase]))
            matrix = np.kron(np.eye(n_dofs)[:n_observed], row)
            noise = library.noise_covariance(dofs, PERIOD_S)
            mean, covariance, _ = full_state_update(
                mean, covariance, matrix, observation.values, noise
            )


def _plan(estimator: IntentEstimator) -> Result:
    times, positions, velocities, _ = estimator.predict_controlled().trajectory
    path = make_path(times, positions, LWR_LIMITS, velocities)
    nominal = NominalTiming(-PLAN_AFTER_S, path.duration_s)
    start = Reference.at_rest(positions[0])
    work = partial(plan_interaction, path, nominal, start, 0.0, 0.0, LWR_LIMITS)
    return Result(
        "one plan within the limits",
        1e3 * seconds(work, 10),
        20.0,
        "at most",
        "ms",
        "half the period of 25 commands a second",
    )
