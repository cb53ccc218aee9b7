# SPDX-License-Identifier: Apache-2.0
"""Short names of the arrays that most functions take and give."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]
