# SPDX-License-Identifier: Apache-2.0
"""Two simulated coworkers assemble a box (Maeda et al. 2014, part IV-C)."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
