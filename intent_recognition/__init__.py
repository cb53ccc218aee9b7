# SPDX-License-Identifier: Apache-2.0
"""Recognise a coworker's task from the first motion and move the robot in time."""

__version__ = "0.1.0"
