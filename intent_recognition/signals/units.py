# SPDX-License-Identifier: Apache-2.0
"""Which DOFs may be measured by one scale.

Constants in metres and radians hold for these two alone. Newtons, pixels and all else are measured
by how far the demonstrations go in them, so that nothing depends on how large their unit is.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

SPATIAL_UNITS = ("m", "rad")
"""Units that constants are given in. Their numbers are added, too: over the reach of an arm, a
radian at a joint is a metre at the hand. Convention."""


def commensurate(units: Sequence[str]) -> list[NDArray[np.int64]]:
    """Indices of the DOFs whose numbers may be added: metres and radians, then each other unit.

    Args:
        units: of the DOFs, (D,).
    """
    kinds = ["" if unit in SPATIAL_UNITS else f"in {unit}" for unit in units]
    return [np.flatnonzero([own == kind for own in kinds]) for kind in sorted(set(kinds))]


def is_spatial(units: Sequence[str]) -> NDArray[np.bool_]:
    """Whether each DOF is in metres or radians, (D,)."""
    return np.array([unit in SPATIAL_UNITS for unit in units], dtype=bool)
