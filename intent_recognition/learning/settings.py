# SPDX-License-Identifier: Apache-2.0
"""Settings of learning."""

from __future__ import annotations

from dataclasses import dataclass

from intent_recognition.errors import ArgumentError, number
from intent_recognition.promp import NormalizedRBFBasis

SEGMENTATIONS = ("movement", "recording")


@dataclass(frozen=True)
class TrainingSettings:
    """How a library is learned.

    Attributes:
        n_basis: basis functions per DOF.
        n_aligned_basis: basis functions per DOF of the aligned primitives.
        width: width of the basis functions in units of their spacing.
        ridge: relative curvature penalty of the weights' regression.
        segmentation: "movement" cuts each recording to the interaction, as the online detector
            would; "recording" takes it whole.
        none_prior: prior probability of an unknown movement; above one minus the threshold of the
            decision, no task is acted on without evidence against `none`.
        duration_evidence: exponent of the evidence in the posterior of a movement's duration, in
            (0, 1]; None lets held-out validation choose it.
        switching: learn the evidence that a change of mind requires, so that the online estimator
            can follow one, and the risk of acting; takes longer than everything else.

    Raises:
        ArgumentError: a setting is out of range.
    """

    n_basis: int = 20
    n_aligned_basis: int = 40
    width: float = 1.0
    ridge: float = 3e-3
    segmentation: str = "movement"
    none_prior: float = 0.11
    duration_evidence: float | None = None
    switching: bool = True

    def __post_init__(self) -> None:
        for n_basis in (self.n_basis, self.n_aligned_basis):
            NormalizedRBFBasis(n_basis, self.width)  # raises if they are invalid
        if not number(self.ridge) > 0:
            raise ArgumentError.about("ridge", "a positive number", self.ridge, "Try 3e-3.")
        if self.segmentation not in SEGMENTATIONS:
            expected = f"one of {SEGMENTATIONS}"
            raise ArgumentError.about("segmentation", expected, self.segmentation, "Choose one.")
        if self.duration_evidence is not None and not 0 < number(self.duration_evidence) <= 1:
            raise ArgumentError.about(
                "duration_evidence", "an exponent in (0, 1]", self.duration_evidence, "Try 0.2."
            )
        if not 0 < number(self.none_prior) < 1:
            expected = "a probability between 0 and 1"
            raise ArgumentError.about("none_prior", expected, self.none_prior, "Try 0.11.")
