# SPDX-License-Identifier: Apache-2.0
"""Recognise a coworker's task from the first motion and move the robot in time.

`import intent_recognition as ir` offers the names listed in `__init__.pyi`; a subpackage is loaded
when one of its names is first used. No name needs ROS, a simulator or a display.
"""

import lazy_loader

__version__ = "0.3.0"

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
