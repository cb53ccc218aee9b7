# SPDX-License-Identifier: Apache-2.0
"""Experiment: one annotated grasp holds other containers."""
