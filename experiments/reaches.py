# SPDX-License-Identifier: Apache-2.0
"""Reaches of the coworker as estimator and activation see them, with a clock of 100 Hz."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from experiments.settings import Settings
from experiments.toolbox.session import watch
from intent_recognition.activation import PredictedInteraction
from intent_recognition.array_types import Floats
from intent_recognition.demonstrations import load_dofs, read_demonstrations
from intent_recognition.kinematics import JointLimits
from intent_recognition.motion import make_path
from intent_recognition.promp import NONE, TaskLibrary
from intent_recognition.recognition import IntentEstimator
from intent_recognition.signals import Demonstration
from sim_bridge.coworker import TASKS, WristSamples, draw_reach, draw_rest, sample_wrist

REST_S, AFTER_S = 1.0, 1.0
"""Time that is observed before and after a reach [s]."""
STEP_NS = 10_000_000
"""Time from one step to the next [ns]: 100 Hz."""
PREDICTED_EVERY = 4
"""Observations from one prediction to the next: 25 Hz."""


class Frame(NamedTuple):
    """What the activation gets at one time.

    Attributes:
        now_ns: when.
        probabilities: of the labels and none; None where nothing was observed.
        log_evidence: of the same; None where nothing was observed.
        prediction: of the interaction where one is due, else None.
    """

    now_ns: int
    probabilities: Floats | None
    log_evidence: Floats | None
    prediction: PredictedInteraction | None


class WatchedReach(NamedTuple):
    """A reach as estimator and tracker see it.

    Attributes:
        task: of the reach.
        onset_s: when it begins, after the first sample.
        goal_m: where the wrist stops (3,), world.
        labels: of the tasks and none.
        samples: of the wrist, at rest before and after.
        frames: what the activation gets.
    """

    task: str
    onset_s: float
    goal_m: Floats
    labels: tuple[str, ...]
    samples: WristSamples
    frames: tuple[Frame, ...]


def toolbox_recordings(settings: Settings) -> list[Demonstration]:
    """The shipped demonstrations."""
    folders = sorted(settings.recordings("toolbox/train").glob("*_*"))
    recordings, _ = read_demonstrations(folders[::4] if settings.quick else folders, load_dofs())
    return recordings


def watch_reach(
    library: TaskLibrary, k: int, rng: np.random.Generator, limits: JointLimits
) -> WatchedReach:
    """Show reach number k, of the tasks in turn, to a new estimator."""
    task = TASKS[k % len(TASKS)]
    reach = draw_reach(rng, task, draw_rest(rng))
    until_s = REST_S + reach.duration_s + AFTER_S
    samples = sample_wrist(rng, [(REST_S, reach)], until_s, gaps_per_s=0.1)
    estimator = IntentEstimator(library)
    frames = []
    for n, seen in enumerate(watch(estimator, samples)):
        prediction = None
        if seen.estimate.moving and n % PREDICTED_EVERY == 0:
            prediction = _prediction(estimator, limits)
        estimate = seen.estimate
        evidence = estimate.log_evidence
        frames.append(Frame(estimate.stamp_ns, estimate.probabilities, evidence, prediction))
    labels = (*library.labels, NONE)
    return WatchedReach(task, REST_S, reach.goal_m, labels, samples, tuple(frames))


def _prediction(estimator: IntentEstimator, limits: JointLimits) -> PredictedInteraction | None:
    """What `primitive_activation` reads from `intent/robot_trajectory`."""
    found = estimator.predict_controlled()
    if found is None:
        return None
    means = found.trajectory
    path = make_path(means.times_s, means.positions, limits, means.velocities)
    onset_ns = found.onset_ns + round(float(means.times_s[0]) * 1e9)
    return PredictedInteraction(found.task, onset_ns, path, {"rad": float(means.std[-1].max())})


def ticks(watched: WatchedReach, home_s: float) -> Iterator[Frame]:
    """Frames every 10 ms of the reach, and of `home_s` after it, in which the person rests."""
    frames = {frame.now_ns: frame for frame in watched.frames}
    first, last = watched.frames[0], watched.frames[-1]
    rests = np.eye(len(watched.labels))[-1]
    for now_ns in range(first.now_ns, last.now_ns + round(home_s * 1e9), STEP_NS):
        nothing = Frame(now_ns, rests if now_ns > last.now_ns else None, None, None)
        yield frames.get(now_ns, nothing)
