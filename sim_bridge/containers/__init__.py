# SPDX-License-Identifier: Apache-2.0
"""Ten cups and bowls with known geometry."""

from sim_bridge.containers.container import Container, Sections
from sim_bridge.containers.generate import CONTAINER_NAMES, make_container

__all__ = ["CONTAINER_NAMES", "Container", "Sections", "make_container"]
