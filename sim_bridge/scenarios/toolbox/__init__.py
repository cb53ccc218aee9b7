# SPDX-License-Identifier: Apache-2.0
"""The toolbox assembly: a worker reaches, the arm hands over."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
