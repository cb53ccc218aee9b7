# SPDX-License-Identifier: Apache-2.0
"""A torque-controlled arm in PyBullet, such as the KUKA LWR 4+: body, controllers, trajectories."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
