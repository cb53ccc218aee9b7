# SPDX-License-Identifier: Apache-2.0
"""Handovers at a box that is moved, with and without knowing where it stands."""
