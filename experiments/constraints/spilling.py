# SPDX-License-Identifier: Apache-2.0
"""Will it pour, and will it all end up in the second container? (Brandl et al. III-A)

Both are logistic regressions on variables divided by reference values of the containers at hand.
These do not depend on size, so that what was learned with one pair holds for the next.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.warping import LogisticModel, References, fit_logistic

RIDGE = 0.1
"""Penalty on weights per standard deviation of a feature: 50 samples may be separable."""

THROWS = np.linspace(0.0, 1.8, 13)
"""Throws that are tried when the throw is learned."""


NO_REFERENCES = References(1.0, 1.0, 1.0, 1.0)
"""Standard features, which know nothing of the container: metres, cubic metres, radians."""


class PouringState(NamedTuple):
    """n states of a container that may pour.

    Attributes:
        fluid_m3: what is in it (n,) or a number.
        tilt_rad: its tilt about the lip, (n,) or a number.
    """

    fluid_m3: Floats | float
    tilt_rad: Floats | float


class FillingState(NamedTuple):
    """n states of a container that pours into a second one.

    Attributes:
        fluid_m3: what is in the first, (n,) or a number.
        second_fluid_m3: what is in the second, (n,) or a number.
        tilt_rad: tilt of the first, (n,) or a number.
        offset_m: lip of the first from the centre of the second's opening (n, 3): in the
            direction of pouring, across it, up.
    """

    fluid_m3: Floats | float
    second_fluid_m3: Floats | float
    tilt_rad: Floats | float
    offset_m: Floats


@dataclass(frozen=True)
class PouringConstraint:
    """Probability that a container pours; `learn` makes one."""

    model: LogisticModel

    @staticmethod
    def features(state: PouringState, cup: References) -> Floats:
        """Tilt and amount in parts of the container's own (n, 2)."""
        columns = (
            np.asarray(state.tilt_rad, dtype=float) / cup.tilt_rad,
            np.asarray(state.fluid_m3, dtype=float) / cup.volume_m3,
        )
        return _stack(columns)

    @classmethod
    def learn(cls, features: Floats, poured: Floats) -> "PouringConstraint":
        """Learn from features (n, 2) of any containers and labels (n,), 1 where some poured."""
        return cls(fit_logistic(features, poured, ridge=RIDGE))

    def probability(self, state: PouringState, cup: References) -> Floats:
        """Probability (n,) that the container pours."""
        return self.model.probability(self.features(state, cup))


@dataclass(frozen=True)
class FillingConstraint:
    """Probability that nothing ends up beside the second container; `learn` makes one.

    Attributes:
        model: of the features.
        throw: how far beyond the lip the fluid lands, in `unit_throw`; 0 as in the paper.
    """

    model: LogisticModel
    throw: float = 0.0

    @staticmethod
    def features(
        state: FillingState, cup: References, second: References, *, throw: float = 0.0
    ) -> Floats:
        """Features (n, 8): offsets and their squares, and amounts and tilt, all as ratios.

        Horizontal distances are divided by the second's radius, the vertical one by the first's
        height. A linear function of distances alone has no middle: squares of the horizontal
        ones are features as well.

        Args:
            state: n states.
            cup: the first container.
            second: the other one.
            throw: measure the offset along to where it lands, in `unit_throw` ahead of the lip.
        """
        along, across = (state.offset_m[:, :2] / second.opening_radius_m).T
        columns = (
            along,
            along**2,
            across,
            across**2,
            state.offset_m[:, 2] / cup.height_m,
            np.asarray(state.second_fluid_m3, dtype=float) / second.volume_m3,
            np.asarray(state.fluid_m3, dtype=float) / cup.volume_m3,
            np.asarray(state.tilt_rad, dtype=float) / cup.tilt_rad,
        )
        ahead = throw * FillingConstraint.unit_throw(state, cup, second)
        return landing(_stack(columns), ahead)

    @staticmethod
    def unit_throw(state: FillingState, cup: References, second: References) -> Floats:
        """Unit of the throw (n,): sqrt(height of the first x height above) / radius.

        Not in the paper. The speed after a slide down a wall without friction grows with the square
        root of its length, the time of the fall with that of the height.
        """
        above = np.maximum(state.offset_m[:, 2], 0.0)
        return np.sqrt(cup.height_m * above) / second.opening_radius_m

    @classmethod
    def learn_throw(
        cls, features: Floats, unit_throw: Floats, filled: Floats
    ) -> "FillingConstraint":
        """Learn the throw as well: the one under which the labels are most probable.

        Args:
            features: (n, 8) without throw.
            unit_throw: (n,).
            filled: labels (n,), 1 where nothing fell beside.
        """

        def learned(throw: float) -> tuple[float, LogisticModel]:
            moved = landing(features, throw * unit_throw)
            model = fit_logistic(moved, filled, ridge=RIDGE)
            odds = model.log_odds(moved)
            return float(np.sum(filled * odds - np.logaddexp(0.0, odds))), model

        found = [learned(float(throw)) for throw in THROWS]
        best = max(range(len(found)), key=lambda k: found[k][0])
        return cls(found[best][1], float(THROWS[best]))

    def probability(self, state: FillingState, cup: References, second: References) -> Floats:
        """Probability (n,) that all that is poured ends up in the second container."""
        return self.model.probability(self.features(state, cup, second, throw=self.throw))


def spill_risk(
    pouring: PouringConstraint,
    filling: FillingConstraint,
    states: FillingState,
    cup: References,
    second: References,
) -> Floats:
    """Probability (n,) that something is poured and not all of it ends up in the second container.

    Check it before a path is executed: it must stay low along the whole path, since liquid that
    leaves the cup on its way is lost.
    """
    leaves = pouring.probability(PouringState(states.fluid_m3, states.tilt_rad), cup)
    return leaves * (1.0 - filling.probability(states, cup, second))


def landing(features: Floats, ahead: Floats) -> Floats:
    """Features (n, 8) of filling with the offset along moved ahead by (n,), in radii."""
    moved = np.array(features)
    moved[:, 0] += ahead
    moved[:, 1] = moved[:, 0] ** 2
    return moved


def _stack(columns: tuple[Floats, ...]) -> Floats:
    """Columns (n,) or single numbers as (n, d)."""
    return np.stack(np.broadcast_arrays(*(np.atleast_1d(c) for c in columns)), axis=1)
