# SPDX-License-Identifier: Apache-2.0
"""Pouring balls from a cup in the arm's hand into a second container."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
