# SPDX-License-Identifier: Apache-2.0
"""Objects handed over by force between an arm and a person: the physics, and the robot's side."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
