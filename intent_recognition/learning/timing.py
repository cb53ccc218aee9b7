# SPDX-License-Identifier: Apache-2.0
"""How recordings of a task are brought onto a common timing before their weights are taken.

The templates and the spread of people's leads are settled once, from the recordings at hand, and
are part of what makes an example; a later recording is warped onto the same template, for itself
(Maeda et al. 2014, part III-E).
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from intent_recognition.alignment import Template, Warp, align, align_to, even_trajectory
from intent_recognition.promp import PhaseDeviation
from intent_recognition.signals import Signal

N_LEAD_PHASES = 51
SMALLEST_LEAD = 0.004
UNKNOWN_LEAD = 0.03
"""Standard deviations of the lead: the least, and that where no task has two recordings."""
LEAD_CORRELATION = 0.4
DEVIATION_EVIDENCE = 0.3
"""See `promp.PhaseDeviation`, and docs/prediction.md for what was tried."""


@dataclass(frozen=True, eq=False)
class Timing:
    """Templates of tasks, and how far recordings lead or lag behind them.

    Attributes:
        templates: of each label that had two recordings.
        deviation_std: standard deviation of the lead at even recorded phases, (U,).
    """

    templates: Mapping[str, Template]
    deviation_std: np.ndarray

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Timing) or self.templates.keys() != other.templates.keys():
            return False
        pairs = [(self.deviation_std, other.deviation_std)]
        for label, template in self.templates.items():
            pairs += zip(template, other.templates[label], strict=True)
        return all(np.array_equal(ours, theirs) for ours, theirs in pairs)

    __hash__ = None

    @property
    def phase_deviation(self) -> PhaseDeviation:
        """The prior of a person's lead."""
        return PhaseDeviation(self.deviation_std, LEAD_CORRELATION, DEVIATION_EVIDENCE)

    def warps(self, recordings: Sequence) -> list[Warp]:
        """From reference phase to the recorded phase of each; the identity without a template."""
        found = [Warp.identity()] * len(recordings)
        for label, indices in _by_task(recordings).items():
            if label in self.templates:
                paths = [_path(recordings[index]) for index in indices]
                warps = align_to(self.templates[label], paths)
                for index, warp in zip(indices, warps, strict=True):
                    found[index] = warp
        return found


def settle_timing(recordings: Sequence) -> Timing:
    """Templates and leads of recordings that are cut to their movements.

    Args:
        recordings: labelled demonstrations; those without a sample of some signal are
            passed over.
    """
    usable = [recorded for recorded in recordings if _has_samples(recorded)]
    templates, leads = {}, []
    for label, indices in _by_task(usable).items():
        if len(indices) < 2:
            continue
        alignment = align([_path(usable[index]) for index in indices])
        templates[label] = alignment.template
        leads.append(_leads(alignment.warps))
    return Timing(dict(sorted(templates.items())), _lead_std(leads))


def _leads(warps: Iterable[Warp]) -> np.ndarray:
    """Reference phase less recorded phase of each warp at even recorded phases, (n, U)."""
    recorded = np.linspace(0.0, 1.0, N_LEAD_PHASES)
    return np.array([np.clip(warp.inverse(recorded), 0.0, 1.0) for warp in warps]) - recorded


def _lead_std(leads: Sequence[np.ndarray]) -> np.ndarray:
    """Standard deviation of the lead, pooled over tasks, (U,).

    Recordings begin and end with the movement, so that nobody leads there: the variance is that of
    a bridge, c^2 4 u (1 - u), with c from the warps.
    """
    phase = np.linspace(0.0, 1.0, N_LEAD_PHASES)
    bridge = 4.0 * phase * (1.0 - phase)
    largest = UNKNOWN_LEAD
    if leads:
        inner = slice(1, -1)
        freedom = sum(len(rows) - 1 for rows in leads)
        variance = sum(np.sum(rows**2, axis=0) for rows in leads) / freedom
        largest = np.sqrt(np.mean(variance[inner] * bridge[inner]) / np.mean(bridge[inner] ** 2))
    return np.maximum(largest * np.sqrt(bridge), SMALLEST_LEAD)


def _by_task(recordings: Sequence) -> dict[str, list[int]]:
    groups: dict[str, list[int]] = {}
    for index, recorded in enumerate(recordings):
        groups.setdefault(str(recorded.task), []).append(index)
    return groups


def _has_samples(recorded) -> bool:
    signals: Sequence[Signal] = (*recorded.observed, *recorded.controlled)
    start_ns, end_ns = recorded.start_ns, recorded.end_ns
    return end_ns > start_ns and all(
        signal.between(start_ns, end_ns).stamps_ns.size for signal in signals
    )


def _path(recorded) -> np.ndarray:
    """All DOFs at even recorded phases, (T, D)."""
    signals = (*recorded.observed, *recorded.controlled)
    return even_trajectory(signals, recorded.start_ns, recorded.end_ns)
