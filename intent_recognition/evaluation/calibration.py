# SPDX-License-Identifier: Apache-2.0
"""Calibration of recognition and prediction: predicted values beside true ones."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence

import numpy as np
from scipy.special import ndtri

from intent_recognition.array_types import Floats, Integers
from intent_recognition.errors import ArgumentError, ShapeError, check_whole
from intent_recognition.promp import NONE
from intent_recognition.signals import as_numbers

INTERVALS = (0.5, 0.6827, 0.8, 0.9, 0.9545, 0.99)
"""Probabilities of the normal distribution's central intervals that are compared."""


class RecognitionRecords:
    """Recognised tasks of many recordings, by kind of phase and observed share.

    Attributes:
        mistaken: recordings recognised as another task even when fully observed with unknown
            phase; by name, the true and the recognised task.
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
        """Add one recording at one observed share: probabilities (K,), and whether none led."""
        self._records[phase][fraction].append((truth, tuple(labels), probabilities, none))
        answer = labels[int(np.argmax(probabilities))]
        if fraction == 1.0 and phase == "unknown_phase" and answer != truth:
            self.mistaken.append({"recording": name, "true": truth, "recognised": answer})

    def confusion(self) -> dict[str, dict[str, dict]]:
        """Per phase and share: true tasks in rows, recognised ones in columns, none in the last."""
        every = [one for by in self._records.values() for rows in by.values() for one in rows]
        tasks = {name for truth, labels, _, _ in every for name in (truth, *labels)}

        def counted(records: list[tuple]) -> dict[str, list]:
            found = [NONE if none else labels[int(np.argmax(p))] for _, labels, p, none in records]
            rows, columns, counts = confusion_counts([t for t, *_ in records], found, tasks)
            return {"true": rows, "recognised": columns, "counts": counts.tolist()}

        return self._by_fraction(counted)

    def accuracy_beside_none(self) -> dict[str, dict[str, dict]]:
        """Per phase and share: accuracy with none as a hypothesis, and without it."""

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
        """Per phase, over all shares and tasks: mean probability, true share and count per bin."""
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
    """Errors of predictions in predicted standard deviations, by kind of phase."""

    def __init__(self) -> None:
        self._inside: dict[str, list[Floats]] = defaultdict(list)

    def add(self, phase: str, normalised_error: Floats) -> None:
        """Add one prediction: errors divided by their standard deviations, any shape."""
        size = np.abs(normalised_error).ravel()
        half_widths = ndtri(0.5 + 0.5 * np.array(INTERVALS))
        self._inside[phase].append(np.mean(size[:, None] < half_widths, axis=0))

    def table(self) -> dict[str, dict[str, list[float]]]:
        """Per phase: nominal and actual coverage of each interval, averaged over predictions."""
        return {
            phase: {"should": list(INTERVALS), "does": np.mean(rows, axis=0).tolist()}
            for phase, rows in self._inside.items()
        }


def confusion_counts(
    true: Sequence[str], recognised: Sequence[str], tasks: Iterable[str] = ()
) -> tuple[list[str], list[str], Integers]:
    """Rows (true tasks and `tasks`), columns (all tasks, `none` last), and counts of pairs."""
    rows = sorted({*true, *tasks})
    columns = [*sorted({*rows, *recognised} - {NONE, ""}), NONE]
    counts = np.zeros((len(rows), len(columns)), dtype=int)
    for task, name in zip(true, recognised, strict=True):
        counts[rows.index(task), columns.index(name or NONE)] += 1
    return rows, columns, counts


def reliability_bins(
    probabilities: Floats, truth: Floats, n_bins: int = 10
) -> tuple[Floats, Floats, Integers]:
    """Mean probability, true share and count per bin of probability, each (B,).

    Args:
        probabilities: (n,) in [0, 1].
        truth: (n,) 1 where the event happened, else 0.
        n_bins: number B of bins, which have equal width.

    Raises:
        ShapeError: there is not one truth for each probability.
        ArgumentError: a number is no probability, or there is no bin.
    """
    check_whole("n_bins", n_bins, 1, "Pass 10, for instance.")
    given = {"probabilities": probabilities, "truth": truth}
    probabilities, truth = (as_numbers(argument, of) for argument, of in given.items())
    if probabilities.ndim != 1 or truth.shape != probabilities.shape:
        got, cure = f"{probabilities.shape} and {truth.shape}", "Pass one truth for each."
        raise ShapeError.about("probabilities, truth", "shape (n,) of both", got, cure)
    for argument, of in (("probabilities", probabilities), ("truth", truth)):
        if not np.all((of >= 0.0) & (of <= 1.0)):  # also where one is NaN
            got, cure = of[~((of >= 0.0) & (of <= 1.0))][0], "Leave out what is not known."
            raise ArgumentError.about(argument, "numbers from 0 to 1", got, cure)
    bins = np.minimum((probabilities * n_bins).astype(int), n_bins - 1)
    counts = np.bincount(bins, minlength=n_bins)
    divisor = np.where(counts > 0, counts, np.nan)
    mean = np.bincount(bins, probabilities, n_bins) / divisor
    return mean, np.bincount(bins, truth, n_bins) / divisor, counts


def _or_none(values: Floats) -> list[float | None]:
    return [None if np.isnan(value) else float(value) for value in values]
