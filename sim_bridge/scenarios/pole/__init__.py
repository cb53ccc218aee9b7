# SPDX-License-Identifier: Apache-2.0
"""The pole: a person points at spots behind it, the arm reaches them on one side or the other."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
