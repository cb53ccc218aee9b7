# SPDX-License-Identifier: Apache-2.0
"""Kinesthetic demonstrations of the toolbox tasks, simulated and recorded."""
