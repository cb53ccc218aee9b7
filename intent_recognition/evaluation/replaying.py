# SPDX-License-Identifier: Apache-2.0
"""The online estimator over a recording, without ROS."""

from collections import Counter
from collections.abc import Iterator

import numpy as np

from intent_recognition.bags import BagReader
from intent_recognition.demonstrations import Source, is_raw_pose, iter_samples
from intent_recognition.model import Model, frames_of
from intent_recognition.promp import NONE
from intent_recognition.recognition import (
    DecisionSettings,
    DecisionState,
    Estimate,
    IntentEstimator,
    decide,
    decision_settings,
    uncertain_end,
)
from intent_recognition.tracking import IngestSettings


def estimates(
    estimator: IntentEstimator, reader: BagReader, model: Model, rejected: Counter[str]
) -> Iterator[Estimate]:
    """Show a recording to an estimator; its estimate after each observation of the human.

    Args:
        estimator: of this model.
        reader: the recording.
        model: its DOF file says what is read, and the frame it was learned in is the world.
        rejected: filled with the number of dropped observations, by reason.
    """
    for source, observation in iter_samples(reader, model.dofs, _ingest_settings(model), rejected):
        if source is Source.CONTROLLED:
            estimator.update_controlled(observation)
            continue
        if source is Source.CONTEXT:
            estimator.update_context(observation)
            continue
        reason = estimator.reason_to_reject(observation)
        if reason is not None:
            rejected[reason] += 1
            continue
        yield estimator.update(observation)


def _ingest_settings(model: Model) -> IngestSettings | None:
    """What `mocap_ingest` is to be told for a model; None for its defaults, and the extrinsics."""
    raw = {entry.topic for entry in model.dofs.recorded if is_raw_pose(entry.topic, entry.type)}
    frames = {f for topic, found in frames_of(model.library).items() if topic in raw for f in found}
    if model.dofs.extrinsics is not None or len(frames) != 1:
        return None
    return IngestSettings(world_frame=frames.pop())


def replay(
    reader: BagReader,
    model: Model,
    rejected: Counter[str] | None = None,
    settings: DecisionSettings | None = None,
    held_back: dict[str, str] | None = None,
) -> Iterator[dict]:
    """One dictionary per observation: stamp [ns], probabilities, phase, active task.

    Args:
        reader: the recording.
        model: the trained model; its own DOF file says what is read.
        rejected: filled with the number of dropped observations, by reason.
        settings: of the decision; the node's defaults when None.
        held_back: filled with the last reason why a recognised task was not active, by task.
    """
    rejected = Counter() if rejected is None else rejected
    settings = settings or decision_settings(model.library)
    held_back = {} if held_back is None else held_back
    estimator, state = IntentEstimator(model.library), DecisionState()
    labels = (*model.library.labels, NONE)
    for estimate in estimates(estimator, reader, model, rejected):
        end_std = None
        if estimate.moving and np.argmax(estimate.probabilities) < model.library.n_tasks:
            end_std = estimator.predicted_end_std()
        state, active = decide(
            settings, state, labels, estimate.probabilities, end_std, estimate.log_evidence
        )
        reason = uncertain_end(settings, state, end_std)
        if reason:
            held_back[state.candidate] = reason
        yield {
            "stamp": estimate.stamp_ns,
            "probabilities": dict(zip(labels, estimate.probabilities.tolist(), strict=True)),
            "phase": dict(zip(labels, estimate.phase.tolist(), strict=True)),
            "active_task": active,
        }
