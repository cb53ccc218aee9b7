# SPDX-License-Identifier: Apache-2.0
"""The ROS 2 nodes: they translate between messages and the library, and do not think.

A file for each node, by the name of its executable (`registry.NODES`), and one for each of its
inputs and outputs that is more than a callback.
"""

import os

# Before anything here loads numpy: the matrices are small, and threads of BLAS that wait for one
# another cost tens of milliseconds an observation where other processes want the cores.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
