# SPDX-License-Identifier: Apache-2.0
"""Whether a path is expected to spill, by constraints learned from trials with one cup."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from experiments.constraints.spilling import (
    FillingConstraint,
    FillingState,
    PouringConstraint,
    PouringState,
    spill_risk,
)
from experiments.constraints.trials import FILLING, FILLING_TILT_RAD, POURING, SECOND
from experiments.constraints.trials_file import TRIALS_FILE, read_trials
from intent_recognition.array_types import Floats
from intent_recognition.share import share_path
from intent_recognition.warping import References
from sim_bridge.containers import CONTAINER_NAMES
from sim_bridge.scenarios.pouring import HALF_FULL, PourPath, Seen

HIGHEST_RISK = 0.5
"""A path is executed if the probability of a spill stays below this along all of it."""


@dataclass(frozen=True)
class Constraints:
    """When a cup pours, and when all of it ends up in the second container."""

    pouring: PouringConstraint
    filling: FillingConstraint

    def risk(self, path: PourPath, cup: References, second: References) -> Floats:
        """Probability (T,) that something is poured and falls beside, along a path.

        Until the cup is tilted most it is taken to be half full; after that nothing more is
        expected to leave it.
        """
        todo = np.arange(len(path.times_s)) <= np.argmax(path.tilt_rad)
        fluid = np.where(todo, HALF_FULL * cup.volume_m3, 0.0)
        states = FillingState(fluid, 0.0, path.tilt_rad, path.offset_m)
        return np.where(todo, spill_risk(self.pouring, self.filling, states, cup, second), 0.0)


def learn_constraints(cup: str, seen_as: Callable[[str], Seen]) -> Constraints:
    """Learn from all shipped trials with one cup; `seen_as` estimates a container by a scan."""
    tables, index = read_trials(share_path(TRIALS_FILE)).tables, CONTAINER_NAMES.index(cup)
    own, second = seen_as(cup).references, seen_as(SECOND).references
    pouring = {n: v[tables[POURING]["object"] == index] for n, v in tables[POURING].items()}
    filling = {n: v[tables[FILLING]["object"] == index] for n, v in tables[FILLING].items()}
    state = PouringState(pouring["fluid_m3"], pouring["tilt_rad"])
    features = PouringConstraint.features(state, own)
    offset = np.column_stack([filling[f"lip_{axis}_m"] for axis in "xyz"])
    filled = FillingState(filling["fluid_m3"], filling["second_fluid_m3"], FILLING_TILT_RAD, offset)
    return Constraints(
        PouringConstraint.learn(features, (pouring["poured"] > 0.0).astype(float)),
        FillingConstraint.learn_throw(
            FillingConstraint.features(filled, own, second),
            FillingConstraint.unit_throw(filled, own, second),
            filling["success"],
        ),
    )
