# SPDX-License-Identifier: Apache-2.0
"""The torque-controlled KUKA LWR 4+ in PyBullet: body, controllers, trajectories."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
