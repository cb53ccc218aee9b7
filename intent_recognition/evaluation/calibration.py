# SPDX-License-Identifier: Apache-2.0
"""Are probabilities and standard deviations to be believed? What was said beside what was true."""

from collections import defaultdict
from collections.abc import Sequence

import numpy as np

from intent_recognition.promp import NONE

N_BINS = 10
LEVELS = (0.5, 0.6827, 0.8, 0.9, 0.9545, 0.99)
"""Shares that regions of the normal distribution should hold."""
QUANTILES = (0.67449, 1.0, 1.28155, 1.64485, 2.0, 2.57583)
"""Half their widths in standard deviations."""


class Recognitions:
    """What was said about the tasks of many recordings, by phase knowledge and share observed."""

    def __init__(self):
        self._said: dict[str, dict[float, list[tuple]]] = defaultdict(lambda: defaultdict(list))

    def add(
        self,
        phase: str,
        fraction: float,
        truth: str,
        labels: Sequence[str],
        probabilities: np.ndarray,
        none: bool,
    ) -> None:
        """Take one recording at one share observed.

        Args:
            phase: key of the phase knowledge.
            fraction: share observed.
            truth: the true task.
            labels: the K tasks.
            probabilities: theirs, without none, (K,).
            none: whether none was more probable than any of them.
        """
        self._said[phase][fraction].append((truth, tuple(labels), probabilities, none))

    def confusion(self) -> dict[str, dict[str, dict[str, object]]]:
        """Per phase and share: rows are true tasks, columns what was said, none the last."""
        tasks = sorted(
            {
                name
                for by in self._said.values()
                for said in by.values()
                for t, labels, _, _ in said
                for name in (t, *labels)
            }
        )
        columns = [*tasks, NONE]
        content: dict[str, dict[str, dict[str, object]]] = {}
        for phase, by_fraction in self._said.items():
            content[phase] = {}
            for fraction, said in sorted(by_fraction.items()):
                counts = np.zeros((len(tasks), len(columns)), dtype=int)
                for truth, labels, p, none in said:
                    answer = NONE if none else labels[int(np.argmax(p))]
                    counts[tasks.index(truth), columns.index(answer)] += 1
                content[phase][str(fraction)] = {
                    "true": tasks,
                    "recognised": columns,
                    "counts": counts.tolist(),
                }
        return content

    def accuracy_beside_none(self) -> dict[str, dict[str, dict[str, float]]]:
        """Per phase and share: how often the true task led, none competing and not."""
        content: dict[str, dict[str, dict[str, float]]] = {}
        for phase, by_fraction in self._said.items():
            content[phase] = {}
            for fraction, said in sorted(by_fraction.items()):
                right = [t == labels[int(np.argmax(p))] for t, labels, p, _ in said]
                led = [r and not none for r, (*_, none) in zip(right, said, strict=True)]
                content[phase][str(fraction)] = {
                    "with_none": float(np.mean(led)),
                    "without_none": float(np.mean(right)),
                }
        return content

    def reliability(self) -> dict[str, dict[str, list]]:
        """Per phase, over all shares and tasks: probability given, share true, count per bin."""
        content = {}
        for phase, by_fraction in self._said.items():
            said = [one for rows in by_fraction.values() for one in rows]
            given = np.concatenate([p for _, _, p, _ in said])
            true = np.concatenate([[t == name for name in labels] for t, labels, _, _ in said])
            mean, share, count = reliability_bins(given, true)
            content[phase] = {
                "probability": _or_none(mean),
                "share_true": _or_none(share),
                "count": count.tolist(),
            }
        return content


class Spreads:
    """How far truth lay from prediction, in the standard deviations that were predicted."""

    def __init__(self):
        self._inside: dict[str, list[np.ndarray]] = defaultdict(list)

    def add(self, phase: str, normalised_error: np.ndarray) -> None:
        """Take one prediction: errors over their standard deviations, any shape."""
        size = np.abs(normalised_error).ravel()
        self._inside[phase].append(np.mean(size[:, None] < np.array(QUANTILES), axis=0))

    def table(self) -> dict[str, dict[str, list[float]]]:
        """Per phase: shares that should lie inside and shares that do, mean over predictions."""
        return {
            phase: {"should": list(LEVELS), "does": np.mean(rows, axis=0).tolist()}
            for phase, rows in self._inside.items()
        }


def reliability_bins(
    probabilities: np.ndarray, truth: np.ndarray, n_bins: int = N_BINS
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean probability, share true and count per bin of probability, each (B,).

    Args:
        probabilities: (n,) in [0, 1].
        truth: (n,) whether what each of them spoke of was true.
        n_bins: bins of equal width B.
    """
    probabilities, truth = np.asarray(probabilities, float), np.asarray(truth, float)
    bins = np.minimum((probabilities * n_bins).astype(int), n_bins - 1)
    counts = np.bincount(bins, minlength=n_bins)
    divisor = np.where(counts > 0, counts, np.nan)
    mean = np.bincount(bins, probabilities, n_bins) / divisor
    return mean, np.bincount(bins, truth, n_bins) / divisor, counts


def _or_none(values: np.ndarray) -> list[float | None]:
    return [None if np.isnan(value) else float(value) for value in values]
