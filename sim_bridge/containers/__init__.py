# SPDX-License-Identifier: Apache-2.0
"""Ten cups and bowls with known geometry."""

from sim_bridge.containers.container import Container, Sections
from sim_bridge.containers.generate import (
    CONTAINER_NAMES,
    CONTAINER_SEED,
    SHAPES,
    TUBE_CORNERS,
    at_heights,
    build_container,
    make_container,
    pieces_between,
)
from sim_bridge.containers.scanning import Camera, scan
