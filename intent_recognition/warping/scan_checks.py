# SPDX-License-Identifier: Apache-2.0
"""What can be said of a cloud before anything is known of the object."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from intent_recognition.errors import ArgumentError

SMALLEST_M = 0.01
"""Smallest extent of a cup or bowl [m]."""
LARGEST_M = 1.5
"""Largest extent of a cup or bowl [m]."""
FLATTEST = 0.03
"""A cloud with a smaller ratio of least to largest standard deviation is a plane."""
N_LOOKED_AT = (500, 4000)
"""A thin rim may be all that joins two walls in one view, and be lost among few points: what looks
like two pieces is looked at closely."""
GAP = 5.0
"""Two pieces are apart by more than so many usual distances between neighbours."""
OTHER_PIECE = 0.25
"""A second piece of more than this share of the largest is another object."""
SUSPECT_PIECE = 0.08
"""Pieces above this share of the largest are named in the message."""


def check_scan(points: NDArray[np.float64]) -> None:
    """Refuse a cloud that cannot be one cup or bowl in metres.

    Args:
        points: (n, 3), finite.

    Raises:
        ArgumentError: wrong unit, flat, or more than one object.
    """
    extent = float(np.linalg.norm(np.ptp(points, axis=0)))
    if not SMALLEST_M < extent < LARGEST_M:
        cure = "Give points in metres; millimetres are scaled by 0.001."
        expected = f"a cup or bowl of {SMALLEST_M} to {LARGEST_M} m"
        raise ArgumentError.about("points", expected, f"{extent:.3g} m across", cure)
    offsets = points - points.mean(0)
    spread = np.sqrt(np.maximum(np.linalg.eigvalsh(offsets.T @ offsets / len(points)), 0.0))
    if spread[0] < FLATTEST * spread[2]:
        cure = "Cut out the object, not the table, and scan it from more sides."
        got = f"one of {1e3 * spread[0]:.2g} by {1e3 * spread[2]:.2g} mm (standard deviations)"
        raise ArgumentError.about("points", "a body with a depth", got, cure)
    for n_looked_at in N_LOOKED_AT:
        sizes = _pieces(points, n_looked_at)
        if len(sizes) == 1 or sizes[1] <= OTHER_PIECE * sizes[0]:
            break
    else:
        cure = "Cut the cloud into objects and warp one at a time."
        got = f"{np.count_nonzero(sizes > SUSPECT_PIECE * sizes[0])} pieces apart from one another"
        raise ArgumentError.about("points", "one object", got, cure)


def _pieces(points: NDArray[np.float64], n_looked_at: int) -> NDArray[np.integer]:
    """Sizes of the pieces of a cloud thinned to about so many points, largest first."""
    looked_at = points[:: max(1, len(points) // n_looked_at)]
    tree = cKDTree(looked_at)
    nearest = np.asarray(tree.query(looked_at, k=2)[0])
    reach_m = GAP * float(np.median(nearest[:, 1]))
    pairs = tree.query_pairs(reach_m, output_type="ndarray")
    n = len(looked_at)
    links = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    _, piece = connected_components(links, directed=False)
    return np.sort(np.bincount(piece))[::-1]
