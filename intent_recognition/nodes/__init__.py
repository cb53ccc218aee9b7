# SPDX-License-Identifier: Apache-2.0
"""The ROS 2 nodes: they translate between messages and the library, and do not think."""

import os

# Before anything here loads numpy: the matrices are small, and threads of BLAS that wait for one
# another cost tens of milliseconds an observation where other processes want the cores.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
