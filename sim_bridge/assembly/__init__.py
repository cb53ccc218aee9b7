# SPDX-License-Identifier: Apache-2.0
"""Two simulated coworkers who assemble a box (Maeda et al. 2014, part IV-C)."""
