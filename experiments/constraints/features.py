# SPDX-License-Identifier: Apache-2.0
"""Features of the trials for the classifiers of the task constraints, by method.

The trials know where containers and balls truly were. A method knows what it made of a scan:
reference values, the lip and the centre of the opening; the standard features know none of these,
only the objects' centres.
"""

from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np

from experiments.constraints.spilling import (
    NO_REFERENCES,
    FillingConstraint,
    FillingState,
    PouringConstraint,
    PouringState,
)
from experiments.constraints.trials import FILLING, FILLING_TILT_RAD, POURING, SECOND, container
from experiments.constraints.trials_file import Trials
from intent_recognition.array_types import Floats, Integers
from intent_recognition.warping import (
    ObjectCloud,
    ObjectModel,
    References,
    pouring_parameters,
    warp_object,
)
from sim_bridge.balls import level_axes
from sim_bridge.containers import CONTAINER_NAMES, scan

LABEL, POINT, STANDARD = METHODS = ("label mapping", "point mapping", "standard features")
MAPPINGS: dict[str, Literal["label", "point"]] = {LABEL: "label", POINT: "point"}
"""How the warping methods transfer the parts of the annotated object to a scan."""

DIFFERENCE, THROW = "label mapping, tilt less reference", "label mapping, and the throw"
THROW_STANDARD = "standard, and the throw of a usual cup"
UPRIGHT = "standard, centres of upright cups"
THROW_UPRIGHT = "standard, upright, and the throw of a usual cup"
STANDARDS = (STANDARD, UPRIGHT, THROW_STANDARD, THROW_UPRIGHT)
"""Features of filling without reference values."""

OTHER_AHEAD_M = 0.2
"""Where the other container is, from this one's opening, when the lip is chosen [m]."""

USUAL_HEIGHT_M = 0.1
"""Height of every cup [m] for standard features that learn the throw."""


class KnownContainer(NamedTuple):
    """What a method knows of one container.

    Attributes:
        references: what its variables are divided by.
        lip_m: the point of it that moves over the second container (3,), in its own frame.
        centre_m: the point of it that distances are measured from (3,), in its own frame.
    """

    references: References
    lip_m: Floats
    centre_m: Floats


class ConstraintSamples(NamedTuple):
    """Trials as a classifier sees them.

    Attributes:
        features: (N, d).
        labels: (N,), 0 or 1.
        objects: (N,) index of the pouring container.
        unit_throw: (N,) unit of the throw, where it is learned; in filling only.
    """

    features: Floats
    labels: Floats
    objects: Integers
    unit_throw: Floats | None = None


def know_all(
    source: ObjectModel, rng: np.random.Generator, indices: Sequence[int]
) -> dict[str, dict[int, KnownContainer]]:
    """Scan containers and estimate their parameters, by method and object index."""
    known: dict[str, dict[int, KnownContainer]] = {method: {} for method in METHODS}
    for index in indices:
        cup = container(index)
        seen = scan(cup.mesh, rng)
        cloud = ObjectCloud(seen.points, seen.normals)
        for method, mapping in MAPPINGS.items():
            warped = warp_object(source, cloud, mapping)
            ahead = cup.opening_centre + np.array([OTHER_AHEAD_M, 0.0, 0.0])
            found = pouring_parameters(warped, toward=ahead)
            known[method][index] = KnownContainer(
                found.references, found.lip_point, found.opening_centre
            )
        middle = cup.mesh.bounds.mean(axis=0)
        known[STANDARD][index] = KnownContainer(NO_REFERENCES, middle, middle)
    return known


def pouring_samples(
    trials: Trials, known: dict[int, KnownContainer], *, difference: bool = False
) -> ConstraintSamples:
    """Features of the pouring trials; `difference` takes the tilt less its reference, not their
    ratio.
    """
    table = trials.tables[POURING]
    objects = table["object"].astype(int)
    features = np.empty((len(objects), 2))
    for index in np.unique(objects):
        rows, cup = objects == index, known[index].references
        state = PouringState(table["fluid_m3"][rows], table["tilt_rad"][rows])
        features[rows] = PouringConstraint.features(state, cup)
        if difference:
            features[rows, 0] = state.tilt_rad - cup.tilt_rad
    return ConstraintSamples(features, (table["poured"] > 0.0).astype(float), objects)


def filling_samples(
    trials: Trials, known: dict[int, KnownContainer], *, upright: bool = False, throw: bool = False
) -> ConstraintSamples:
    """Features of the filling trials.

    `upright` measures to the pouring container as if it stood upright; `throw` lets the classifier
    learn the throw, too.
    """
    table = trials.tables[FILLING]
    objects = table["object"].astype(int)
    second_index = CONTAINER_NAMES.index(SECOND)
    second, true_second = known[second_index], container(second_index)
    features, unit_throw = np.empty((len(objects), 8)), np.empty(len(objects))
    for index in np.unique(objects):
        rows, cup = np.flatnonzero(objects == index), known[index]
        lip = np.column_stack([table[f"lip_{axis}_m"][rows] for axis in "xyz"])
        turned = np.eye(3) if upright else level_axes(FILLING_TILT_RAD)
        first = lip + turned @ (cup.lip_m - container(index).lip_point)
        offset = first - (second.centre_m - true_second.opening_centre)
        state = FillingState(
            table["fluid_m3"][rows], table["second_fluid_m3"][rows], FILLING_TILT_RAD, offset
        )
        own, other = cup.references, second.references
        features[rows] = FillingConstraint.features(state, own, other)
        known_height = own._replace(height_m=USUAL_HEIGHT_M) if own is NO_REFERENCES else own
        unit_throw[rows] = FillingConstraint.unit_throw(
            state._replace(offset_m=lip), known_height, other
        )
    return ConstraintSamples(features, table["success"], objects, unit_throw if throw else None)
