# SPDX-License-Identifier: Apache-2.0
"""Ten cups and bowls with known geometry."""

from sim_bridge.containers.container import Container
from sim_bridge.containers.generate import (
    CONTAINER_NAMES,
    CONTAINER_SEED,
    SHAPES,
    build_container,
    make_container,
)
from sim_bridge.containers.scanning import Camera, scan
from sim_bridge.containers.surfaces import TUBE_CORNERS, at_heights, pieces_between
