# SPDX-License-Identifier: Apache-2.0
"""Recorded pours: what became of their balls, with warped and with unwarped references."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from experiments.pouring.executed import MEAN, SAMPLE, UNWARPED, PourOrder, Skill
from intent_recognition.errors import BagError
from sim_bridge.scenarios.pouring import PAIRS, PourPath, read_pour, seen_as

BALLS_IN_VOLUME = 2
"""Balls that fill a cup for each one in it before a pour: it is half full."""
NAMES = {MEAN: "warped, mean", SAMPLE: "warped, drawn", UNWARPED: "not warped"}


@dataclass(frozen=True)
class RecordedPour:
    """One recorded pour.

    Attributes:
        order: which pair and path.
        path: of the lip, from the arm's joints.
        spilled: balls in neither container at the end.
        kept: balls left in the cup.
        n_balls: in the cup at the start.
        through_wall: balls that went into or through a wall.
        risk: of a spill, expected before it was executed.
        touched_s: how long the cup touched the second container.
        strongest_touch_n: largest force of that touch.
        left_m3: what was to be left in the cup; None where no level was asked for.
    """

    order: PourOrder
    path: PourPath
    spilled: int
    kept: int
    n_balls: int
    through_wall: int
    risk: float
    touched_s: float
    strongest_touch_n: float
    left_m3: float | None = None

    @property
    def wanted(self) -> float:
        """Balls that were to be left in the cup."""
        volume_m3 = seen_as(PAIRS[self.order.pair][0], self.order.seed).references.volume_m3
        return BALLS_IN_VOLUME * self.n_balls * (self.left_m3 or 0.0) / volume_m3

    @property
    def level_error(self) -> float:
        """How far what is left is from what was to be left, as a share of the cup's volume."""
        return abs(self.kept - self.wanted) / (BALLS_IN_VOLUME * self.n_balls)


def pair_name(pair: int) -> str:
    """Such as "mug into tumbler"."""
    return " into ".join(name.replace("_", " ") for name in PAIRS[pair])


def read_recorded(folder: Path) -> list[RecordedPour]:
    """All recorded pours below a folder.

    Raises:
        BagError: there are none.
    """
    found = []
    for note in sorted(folder.glob("*/metadata.yaml")):
        path, labels = read_pour(note.parent)
        seed, pair = int(labels["seed"]), int(labels["pair"])
        order = PourOrder(seed, pair, labels["manner"], labels.get("pour", ""))
        counts = (int(labels[n]) for n in ("spilled", "kept", "balls", "through_wall"))
        measured = (float(labels[n]) for n in ("risk", "touched_s", "strongest_touch_n"))
        left = 1e-6 * float(labels["left_ml"]) if order.pour else None
        found.append(replace(RecordedPour(order, path, *counts, *measured), left_m3=left))
    if not found:
        cure = "Make them with `python -m experiments.generate --scenario pours`."
        raise BagError.about(str(folder), "recorded pours", "none", cure)
    return found


def of_manner(pours: Sequence[RecordedPour], manner: str) -> list[RecordedPour]:
    """Those along one kind of path, in the order of the pairs; none to a level."""
    chosen = (p for p in pours if p.order.manner == manner and not p.order.pour)
    return sorted(chosen, key=lambda p: p.order.pair)


def to_level(pours: Sequence[RecordedPour]) -> list[RecordedPour]:
    """Those to a level that was asked for, in the order of the pairs."""
    return sorted((p for p in pours if p.order.pour), key=lambda p: (p.order.pair, -p.wanted))


def carried_tilt(skill: Skill) -> float:
    """Largest tilt ratio, mean and two sigma, before the lip is above the opening."""
    phase = np.linspace(0.0, 1.0, 400)
    mean, std = skill.primitive.mean_path(phase), skill.primitive.std_path(phase)
    above = np.hypot(mean[:, 0], mean[:, 1]) < 1.0
    before = np.arange(len(phase)) < np.argmax(above)
    return float((mean[:, 3] + 2.0 * std[:, 3])[before].max())


def numbers_of(
    pours: Sequence[RecordedPour], skill: Skill, repeated: Sequence[tuple[RecordedPour, int, int]]
) -> dict[str, object]:
    """All numbers of the experiment, ready for JSON."""
    numbers: dict[str, object] = {
        "pairs": [pair_name(k) for k in range(len(PAIRS))],
        "through_wall": sum(p.through_wall for p in pours),
        "carried_tilt_ratio": carried_tilt(skill),
        "repeated_alike": sum((p.spilled, p.kept) == (s, k) for p, s, k in repeated),
        "repeated": len(repeated),
        "levels": [
            {
                "pair": pair_name(p.order.pair),
                "pour": p.order.pour,
                "wanted": p.wanted,
                "kept": p.kept,
                "spilled": p.spilled,
                "error": p.level_error,
            }
            for p in to_level(pours)
        ],
    }
    for manner in NAMES:
        chosen = of_manner(pours, manner)
        numbers[f"spilled_{manner}"] = [p.spilled for p in chosen]
        numbers[f"kept_{manner}"] = [p.kept for p in chosen]
        numbers[f"risk_{manner}"] = [p.risk for p in chosen]
        numbers[f"touched_s_{manner}"] = [p.touched_s for p in chosen]
        numbers[f"strongest_touch_n_{manner}"] = [p.strongest_touch_n for p in chosen]
    return numbers
