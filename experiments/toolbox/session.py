# SPDX-License-Identifier: Apache-2.0
"""The coworker's session, shown to the online estimator without ROS and without waiting.

The wrist goes through the same ingest as in the node, then through the same estimator and the same
decision; the arm stands at home whenever a movement begins.
"""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from experiments.recording import EPOCH_NS, SAMPLE_NS
from intent_recognition.array_types import Floats
from intent_recognition.kinematics import hand_position
from intent_recognition.promp import NONE, TaskLibrary
from intent_recognition.recognition import (
    DecisionState,
    Estimate,
    IntentEstimator,
    decide,
    decision_settings,
)
from intent_recognition.signals import Observation
from intent_recognition.tracking import IngestSettings, IngestState, Rejected, ingest_pose
from sim_bridge.coworker import Interaction, SessionPlan, WristSamples
from sim_bridge.scenarios.toolbox import HOME, handover_point

HAND_TASKS = ("plate_handover", "hold_screwdriver")
"""Tasks whose handover follows the wrist; the screw is given at one place."""


class ToolboxExecution(NamedTuple):
    """One interaction of the session.

    Attributes:
        task: what the coworker did.
        recognised: what was acted on first, in the coworker's words, "" if nothing was.
        wrong_first: whether another task was active at any time during it.
        decided_share: share of the movement seen when it was decided, NaN if it was not.
        hand_error_m: where the predicted motion would bring the hand at the end of the
            movement, from where the demonstrator's rule puts it; NaN without a prediction.
    """

    task: str
    recognised: str
    wrong_first: bool
    decided_share: float
    hand_error_m: float

    @property
    def right(self) -> bool:
        """Whether its task was active, and no other one."""
        return self.recognised == self.task and not self.wrong_first


class SeenEstimate(NamedTuple):
    """Time of one observation, and the estimate and the decision after it."""

    time_s: float
    estimate: Estimate
    decision: DecisionState


class _Acted(NamedTuple):
    """The active task after one observation, and the predicted hand (3,) at a movement's end."""

    time_s: float
    active: str
    hand_m: Floats | None


def watch(estimator: IntentEstimator, samples: WristSamples) -> Iterator[SeenEstimate]:
    """Show an estimator the wrist, sample by sample, and decide as the node does by default."""
    settings, decision = decision_settings(estimator.library), DecisionState()
    ingest, state = IngestSettings(), IngestState()
    for k in np.flatnonzero(samples.visible):
        stamp = EPOCH_NS + int(k) * SAMPLE_NS
        pose = samples.positions_m[k], samples.orientations[k]
        state, tracked = ingest_pose(ingest, state, stamp, *pose, "world")
        if isinstance(tracked, Rejected):
            continue
        estimator.update_controlled(Observation(stamp, 0, HOME))
        observation = Observation(stamp, 0, tracked.position, tracked.position_covariance)
        if estimator.reason_to_reject(observation) is not None:
            continue
        estimate = estimator.update(observation)
        p = estimate.probabilities
        end_std = None
        # `decide` asks for the end of a task that may become active, and of no other one.
        if estimate.task not in (NONE, decision.active):
            end_std = estimator.predicted_end_std()
        decision, _ = decide(settings, decision, estimate.labels, p, end_std, estimate.log_evidence)
        yield SeenEstimate(float(samples.times_s[k]), estimate, decision)


def play(
    library: TaskLibrary, names: Mapping[str, str], plan: SessionPlan
) -> list[ToolboxExecution]:
    """Let the estimator see a whole session; `names` has the coworker's word for each label."""
    estimator = IntentEstimator(library)
    ends = [interaction.end_s for interaction in plan.interactions]
    acted: list[_Acted] = []
    for seen in watch(estimator, plan.samples):
        hand = None
        if ends and seen.time_s >= ends[0]:
            hand = predicted_hand(estimator)
            ends.pop(0)
        acted.append(_Acted(seen.time_s, names.get(seen.decision.active, ""), hand))
    return _score(plan.interactions, acted)


def predicted_hand(estimator: IntentEstimator) -> Floats | None:
    """Where the predicted motion ends (3,), None without a prediction."""
    prediction = estimator.predict_controlled(n_points=1)
    return None if prediction is None else hand_position(prediction.trajectory.positions[-1])


def _score(interactions: tuple[Interaction, ...], seen: list[_Acted]) -> list[ToolboxExecution]:
    """Outcome of each interaction, up to the onset of the next one."""
    times = np.array([one.time_s for one in seen])
    limits = [one.onset_s for one in interactions[1:]] + [np.inf]
    executions = []
    for interaction, until_s in zip(interactions, limits, strict=True):
        first, last = np.searchsorted(times, [interaction.onset_s, until_s])
        part = [one for one in seen[first:last] if one.active]
        recognised = part[0].active if part else ""
        share = np.nan
        if part:
            moving_s = interaction.end_s - interaction.onset_s
            share = (part[0].time_s - interaction.onset_s) / moving_s
        hands = [one.hand_m for one in seen[first:last] if one.hand_m is not None]
        error = np.nan
        if hands:
            goal = handover_point(interaction.task, interaction.goal_m)
            error = float(np.linalg.norm(hands[0] - goal))
        executions.append(
            ToolboxExecution(
                interaction.task,
                recognised,
                any(one.active != interaction.task for one in part),
                float(share),
                error,
            )
        )
    return executions
