# SPDX-License-Identifier: Apache-2.0
"""Mixtures of the pole demonstrations, their left-out predictions, and the arm that executes them.

The demonstrations are unlabelled; on which side of the pole the arm was led is known for scoring.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from experiments.draws import Draw, draw_again
from experiments.left_out import (
    FINAL,
    LeftOutMixture,
    Pairs,
    TriedNumber,
    pairs_of,
    predict,
    rms,
    try_numbers,
)
from experiments.pole.geometry import fingertip, planned_clearance, way_of
from experiments.pole.world import PoleRun, execute
from experiments.settings import Settings
from intent_recognition.array_types import Flags, Floats, Integers
from intent_recognition.demonstrations import load_dofs, read_demonstrations
from intent_recognition.learning import MIN_MEMBERS, purity
from intent_recognition.share import share_path
from intent_recognition.signals import Demonstration

LARGEST_NUMBER = 17
"""Largest number of components that is tried."""
QUICK_LARGEST = 3
"""The same in a quick run."""
QUICK_EXECUTED = 2
"""Predicted motions that a quick run carries out."""


@dataclass(frozen=True)
class Carried:
    """Predicted motions on the arm.

    Attributes:
        label: what they were predicted from.
        indices: which demonstrations were left out (m,).
        runs: on the arm, one for each.
        ways: on which side of the pole each was predicted.
        final_error_m: distance of the fingertip from where it was shown to point (m,).
    """

    label: str
    indices: Integers
    runs: tuple[PoleRun, ...]
    ways: tuple[str, ...]
    final_error_m: Floats

    @property
    def hits(self) -> Flags:
        """Which of them touched the pole, bool (m,)."""
        return np.array([run.touched for run in self.runs])

    @property
    def clearance_m(self) -> Floats:
        """Least distance from the pole (m,)."""
        return np.array([run.clearance_m.min() for run in self.runs])


@dataclass(frozen=True)
class PoleStudy:
    """Results of the study.

    Attributes:
        demonstrations: in the order of all arrays.
        pairs: both agents at the same phases.
        ways: how each was led around the pole.
        both: whether its spot can be reached on both sides, bool (n,).
        tried: every number of components.
        chosen: the number taken.
        single: of a single Gaussian, on the arm.
        mixture: of the number taken.
        single_end, mixture_end: the same, predicted from the wand's final position alone.
        draws: the recordings drawn again, the shipped ones first.
    """

    demonstrations: tuple[Demonstration, ...]
    pairs: Pairs
    ways: tuple[str, ...]
    both: Flags
    tried: tuple[TriedNumber, ...]
    chosen: int
    single: Carried
    mixture: Carried
    single_end: Carried
    mixture_end: Carried
    draws: tuple[Draw, ...] = ()

    @property
    def taken(self) -> TriedNumber:
        """Results with the number of components chosen."""
        return self.tried[self.chosen - 1]

    @property
    def tip_rms_m(self) -> Floats:
        """Error of the fingertip by number of components and demonstration (K, n)."""
        return np.array([tip_rms_m(self.pairs, one.predicted) for one in self.tried])

    @property
    def carried(self) -> tuple[Carried, ...]:
        """All motions on the arm."""
        return self.single, self.mixture, self.single_end, self.mixture_end


def investigate(settings: Settings) -> PoleStudy:
    """Fit, predict and execute."""
    settings.progress(0.0, "reading")
    demonstrations = _read(settings.recordings("pole"))
    pairs = pairs_of(demonstrations)
    ways = tuple(d.metadata["way"] for d in demonstrations)
    both = np.array([len(d.metadata["reachable"].split()) == 2 for d in demonstrations])
    largest = QUICK_LARGEST if settings.quick else LARGEST_NUMBER
    tried, chosen = try_numbers(pairs, largest, settings)
    count = QUICK_EXECUTED if settings.quick else len(demonstrations)
    nearest = planned_clearance(tried[0].predicted.mean).min(axis=1)
    indices = np.sort(np.argsort(nearest)[:count])
    taken = tried[chosen - 1]
    carried = []
    for step, (label, predicted) in enumerate(
        (
            ("one component", tried[0].predicted),
            (f"{chosen} components", taken.predicted),
            ("one component, end only", predict(pairs, tried[0].mixtures, FINAL)),
            (f"{chosen} components, end only", predict(pairs, taken.mixtures, FINAL)),
        )
    ):
        settings.progress(0.2 + 0.1 * step, f"on the arm: {label}")
        carried.append(_carry_out(label, pairs, predicted, indices))
    draws = [Draw(settings.seed, _numbers_of_draw(pairs, ways, tried, chosen))]
    if not settings.quick:
        draws += draw_again(
            settings,
            "pole",
            lambda folder: draw(folder / "pole", settings),
            progress=lambda share: settings.progress(0.6 + 0.35 * share, "other seeds"),
        )
    single, mixture, single_end, mixture_end = carried
    return PoleStudy(
        tuple(demonstrations), pairs, ways, both, tried, chosen,
        single, mixture, single_end, mixture_end, tuple(draws),
    )  # fmt: skip


def draw(recordings: Path, settings: Settings) -> dict[str, float]:
    """Results of recordings drawn again; predictions are not executed, but checked as planned."""
    demonstrations = _read(recordings)
    pairs = pairs_of(demonstrations)
    silent = replace(settings, progress=lambda share, what: None)
    tried, chosen = try_numbers(pairs, max(1, len(demonstrations) // MIN_MEMBERS), silent)
    ways = tuple(d.metadata["way"] for d in demonstrations)
    return _numbers_of_draw(pairs, ways, tried, chosen)


def _numbers_of_draw(
    pairs: Pairs, ways: Sequence[str], tried: Sequence[TriedNumber], chosen: int
) -> dict[str, float]:
    """Results of a draw: counts, and mean errors of the path [cm]."""
    single, taken = tried[0], tried[chosen - 1]
    return {
        "components": chosen,
        "in their own": round(purity(list(ways), taken.labels) * len(ways)),
        "path, single": 100.0 * float(tip_rms_m(pairs, single.predicted).mean()),
        "path": 100.0 * float(tip_rms_m(pairs, taken.predicted).mean()),
        "through the pole, single": n_through(single.predicted),
        "through the pole": n_through(taken.predicted),
        "end only, single": n_through(predict(pairs, single.mixtures, FINAL)),
        "end only": n_through(predict(pairs, taken.mixtures, FINAL)),
    }


def _read(recordings: Path) -> list[Demonstration]:
    dofs = load_dofs(share_path("config/dofs_pole.yaml"))
    return read_demonstrations([recordings], dofs)[0]


def tip_rms_m(pairs: Pairs, predicted: LeftOutMixture) -> Floats:
    """Error of the fingertip over all times, of each prediction (n,)."""
    return rms(np.linalg.norm(fingertip(predicted.mean) - fingertip(pairs.controlled), axis=2))


def n_through(predicted: LeftOutMixture) -> int:
    """How many predictions run into the pole, as planned."""
    return int(np.sum(planned_clearance(predicted.mean).min(axis=1) < 0.0))


def _carry_out(label: str, pairs: Pairs, predicted: LeftOutMixture, indices: Integers) -> Carried:
    """Let the arm execute predictions, each in a fresh world with the pole."""
    phase = np.linspace(0.0, 1.0, predicted.mean.shape[1])
    runs = tuple(execute(predicted.mean[i], phase * pairs.duration_s[i]) for i in indices)
    reached = np.array([fingertip(run.positions_rad[-1]) for run in runs])
    shown = fingertip(pairs.controlled[indices, -1])
    return Carried(
        label,
        indices,
        runs,
        tuple(way_of(fingertip(predicted.mean[i])) for i in indices),
        np.linalg.norm(reached - shown, axis=1),
    )
