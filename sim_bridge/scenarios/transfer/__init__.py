# SPDX-License-Identifier: Apache-2.0
"""Objects handed over by force between an arm and a person: physics, trials and their outcomes."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
