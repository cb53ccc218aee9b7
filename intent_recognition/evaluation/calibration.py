# SPDX-License-Identifier: Apache-2.0
"""Calibration of recognition and prediction: what was predicted beside what was true."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence

import numpy as np

from intent_recognition.array_types import Floats, Integers
from intent_recognition.promp import NONE

QUANTILES = {
    0.5: 0.67449,
    0.6827: 1.0,
    0.8: 1.28155,
    0.9: 1.64485,
    0.9545: 2.0,
    0.99: 2.57583,
}
"""Half widths in standard deviations of the central intervals of the normal distribution that
should contain these shares of the truth."""


class RecognitionRecords:
    """Recognised tasks of many recordings, by phase knowledge and share observed.

    Attributes:
        mistaken: recordings that are taken for another task even when all of them was seen, the
            phase unknown: by name, with the true and the recognised task.
    """

    def __init__(self) -> None:
        self.mistaken: list[dict[str, str]] = []
        self._records: dict[str, dict[float, list[tuple]]] = defaultdict(lambda: defaultdict(list))

    def add(
        self,
        phase: str,
        fraction: float,
        truth: str,
        labels: Sequence[str],
        probabilities: Floats,
        none: bool,
        name: str = "",
    ) -> None:
        """Add one recording at one share observed: of the K tasks, (K,), and whether none led."""
        self._records[phase][fraction].append((truth, tuple(labels), probabilities, none))
        answer = labels[int(np.argmax(probabilities))]
        if fraction == 1.0 and phase == "unknown_phase" and answer != truth:
            self.mistaken.append({"recording": name, "true": truth, "recognised": answer})

    def confusion(self) -> dict[str, dict[str, dict]]:
        """Per phase and share: rows are true tasks, columns recognised ones, none the last."""
        every = [one for by in self._records.values() for rows in by.values() for one in rows]
        tasks = sorted({name for truth, labels, _, _ in every for name in (truth, *labels)})
        columns = [*tasks, NONE]

        def counted(records: list[tuple]) -> dict[str, list]:
            counts = np.zeros((len(tasks), len(columns)), dtype=int)
            for truth, labels, p, none in records:
                answer = NONE if none else labels[int(np.argmax(p))]
                counts[tasks.index(truth), columns.index(answer)] += 1
            return {"true": tasks, "recognised": columns, "counts": counts.tolist()}

        return self._by_fraction(counted)

    def accuracy_beside_none(self) -> dict[str, dict[str, dict]]:
        """Per phase and share: accuracy with none competing and without."""

        def accuracy(records: list[tuple]) -> dict[str, float]:
            right = [t == labels[int(np.argmax(p))] for t, labels, p, _ in records]
            led = [r and not none for r, (*_, none) in zip(right, records, strict=True)]
            return {"with_none": float(np.mean(led)), "without_none": float(np.mean(right))}

        return self._by_fraction(accuracy)

    def _by_fraction(self, of: Callable[[list[tuple]], dict]) -> dict[str, dict[str, dict]]:
        return {
            phase: {str(fraction): of(records) for fraction, records in sorted(by.items())}
            for phase, by in self._records.items()
        }

    def reliability(self) -> dict[str, dict[str, list]]:
        """Per phase, over all shares and tasks: probability given, share true, count per bin."""
        content = {}
        for phase, by_fraction in self._records.items():
            records = [one for rows in by_fraction.values() for one in rows]
            given = np.concatenate([p for _, _, p, _ in records])
            true = np.concatenate([[t == name for name in labels] for t, labels, _, _ in records])
            mean, share, count = reliability_bins(given, true)
            content[phase] = {
                "probability": _or_none(mean),
                "share_true": _or_none(share),
                "count": count.tolist(),
            }
        return content


class NormalisedErrors:
    """Errors of predictions in predicted standard deviations, by phase knowledge."""

    def __init__(self) -> None:
        self._inside: dict[str, list[Floats]] = defaultdict(list)

    def add(self, phase: str, normalised_error: Floats) -> None:
        """Add one prediction: errors over their standard deviations, any shape."""
        size = np.abs(normalised_error).ravel()
        self._inside[phase].append(np.mean(size[:, None] < np.array([*QUANTILES.values()]), axis=0))

    def table(self) -> dict[str, dict[str, list[float]]]:
        """Per phase: nominal and actual coverage of each interval, mean over predictions."""
        return {
            phase: {"should": list(QUANTILES), "does": np.mean(rows, axis=0).tolist()}
            for phase, rows in self._inside.items()
        }


def reliability_bins(
    probabilities: Floats, truth: Floats, n_bins: int = 10
) -> tuple[Floats, Floats, Integers]:
    """Mean probability, share true and count per bin of probability, each (B,).

    Args:
        probabilities: (n,) in [0, 1].
        truth: (n,) whether each event was true, 0 or 1.
        n_bins: bins of equal width B.
    """
    probabilities, truth = np.asarray(probabilities, float), np.asarray(truth, float)
    bins = np.minimum((probabilities * n_bins).astype(int), n_bins - 1)
    counts = np.bincount(bins, minlength=n_bins)
    divisor = np.where(counts > 0, counts, np.nan)
    mean = np.bincount(bins, probabilities, n_bins) / divisor
    return mean, np.bincount(bins, truth, n_bins) / divisor, counts


def _or_none(values: Floats) -> list[float | None]:
    return [None if np.isnan(value) else float(value) for value in values]
