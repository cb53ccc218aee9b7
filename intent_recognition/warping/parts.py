# SPDX-License-Identifier: Apache-2.0
"""The parts an object consists of."""

from enum import IntEnum


class Part(IntEnum):
    """Part of a container that a surface point belongs to (Brandl et al. II-A)."""

    CONTAINER = 0
    RIM = 1
    HANDLE = 2
