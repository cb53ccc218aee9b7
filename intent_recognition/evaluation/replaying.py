# SPDX-License-Identifier: Apache-2.0
"""Runs the online estimator over a recording, without ROS."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

from intent_recognition.bags import BagReader
from intent_recognition.demonstrations import Sample, Source, is_raw_pose, iter_samples
from intent_recognition.errors import BagError
from intent_recognition.evaluation.unknown_movements import decide_when_ready
from intent_recognition.model import Model, frames_of
from intent_recognition.promp import NONE
from intent_recognition.recognition import (
    DecisionSettings,
    DecisionState,
    Estimate,
    IntentEstimator,
    decision_settings,
    uncertain_end,
)
from intent_recognition.tracking import IngestSettings


class Decided(NamedTuple):
    """An estimate and the resulting decision."""

    estimate: Estimate  # estimate after an observation of the human
    state: DecisionState  # state of the decision
    # predicted standard deviation of the end, by unit; None where the decision did not need it
    end_std: Mapping[str, float] | None


def samples_of(reader: BagReader, model: Model, rejected: Counter[str]) -> Iterator[Sample]:
    """Samples of a recording that a model reads, in order, in the frame in which it was learned."""
    raw = {entry.topic for entry in model.dofs.recorded if is_raw_pose(entry.topic, entry.type)}
    frames = {f for topic, found in frames_of(model.library).items() if topic in raw for f in found}
    settings = None  # the defaults of `mocap_ingest`, and the extrinsics
    if model.dofs.extrinsics is None and len(frames) == 1:
        settings = IngestSettings(world_frame=frames.pop())
    return iter_samples(reader, model.dofs, settings, rejected)


def no_observation(reader: BagReader, model: Model, rejected: Mapping[str, int]) -> BagError:
    """Error for a recording in which nothing can be followed."""
    dropped = ", ".join(f"{count} {reason}" for reason, count in sorted(rejected.items()))
    return BagError.about(
        str(reader.path),
        f"observations on {', '.join(entry.topic for entry in model.dofs.observed)}",
        f"only {dropped}" if dropped else f"topics {', '.join(reader.topics) or 'none'}",
        "Give a recording with the topics of the model's DOF file, in the frame that"
        " `intent inspect` shows for the model.",
    )


def follow(
    estimator: IntentEstimator, samples: Iterable[Sample], rejected: Counter[str]
) -> Iterator[Estimate]:
    """Feed samples to an estimator; yield its estimate after each observation of the human.

    `rejected` is filled with the number of dropped observations, by reason.
    """
    for source, observation in samples:
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


def decisions(
    estimator: IntentEstimator, settings: DecisionSettings, followed: Iterable[Estimate]
) -> Iterator[Decided]:
    """Decide after each estimate as the activation node does.

    `estimator` must be the one that gives the estimates: it predicts the ends.
    """
    state = DecisionState()
    for estimate in followed:
        current = estimate.labels, estimate.probabilities, estimate.log_evidence
        state, end_std = decide_when_ready(settings, state, *current, estimator.predicted_end_std)
        yield Decided(estimate, state, end_std)


def replay(
    reader: BagReader,
    model: Model,
    rejected: Counter[str] | None = None,
    held_back: dict[str, str] | None = None,
) -> Iterator[dict]:
    """Yield one dictionary per observation: stamp [ns], probabilities, phase, active task.

    Args:
        reader: recording to replay.
        model: trained model, whose DOF file defines what is read.
        rejected: filled with the number of dropped observations, by reason.
        held_back: filled with the last reason that held back each recognised task.

    Raises:
        BagError: nothing that the model observes was recorded.
    """
    rejected = Counter() if rejected is None else rejected
    settings = decision_settings(model.library)
    held_back = {} if held_back is None else held_back
    estimator = IntentEstimator(model.library)
    labels = (*model.library.labels, NONE)
    followed = follow(estimator, samples_of(reader, model, rejected), rejected)
    estimate = None
    for estimate, state, end_std in decisions(estimator, settings, followed):
        reason = uncertain_end(settings, state, end_std)
        if reason:
            held_back[state.candidate] = reason
        yield {
            "stamp": estimate.stamp_ns,
            "probabilities": dict(zip(labels, estimate.probabilities.tolist(), strict=True)),
            "phase": dict(zip(labels, estimate.phase.tolist(), strict=True)),
            "active_task": state.active,
        }
    if estimate is None:
        raise no_observation(reader, model, rejected)
