# SPDX-License-Identifier: Apache-2.0
import numpy as np
from numpy.typing import NDArray

def condition(
    state: NDArray[np.float64],
    index: NDArray[np.int64] | None,
    deviation: NDArray[np.float64],
    dofs: NDArray[np.int64],
    rows: NDArray[np.float64],
    values: NDArray[np.float64],
    noise: NDArray[np.float64],
    transition: NDArray[np.float64] | None,
    density: NDArray[np.float64],
    likelihood: NDArray[np.float64],
    n_dofs: int,
    n_basis: int,
    exponent: float,
    freedom: float,
    /,
) -> int: ...
