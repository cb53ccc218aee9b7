# SPDX-License-Identifier: Apache-2.0
"""Pointing at spots on a table (Maeda et al. 2014, Fig. 4-6): a person first, then the arm."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
