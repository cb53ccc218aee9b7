# SPDX-License-Identifier: Apache-2.0
"""How fast the parts are, beside what is required and, where there is one, beside a peer.

Linear algebra runs on one core here, on both sides of a ratio, so that numbers repeat.
"""

import os

for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(name, "1")
