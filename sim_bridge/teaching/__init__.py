# SPDX-License-Identifier: Apache-2.0
"""Parts that all recordings of the simulation share: the demonstrator's hand, sensors, topics."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
