# SPDX-License-Identifier: Apache-2.0
"""The ROS 2 nodes, which translate between messages and the library.

Each node has a file named after its executable (`registry.NODES`). Inputs and outputs that are
more than a callback have files of their own.
"""

import os

# Set before numpy is loaded. The matrices are small, and BLAS threads that wait for one another
# cost tens of milliseconds per observation when other processes compete for the cores.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
