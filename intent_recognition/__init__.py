# SPDX-License-Identifier: Apache-2.0
"""Interaction primitives: recognise a coworker's task from first motion and move the robot in time."""

__version__ = "0.1.0"
