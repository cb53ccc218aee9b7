# SPDX-License-Identifier: Apache-2.0
"""Time alignment beside dynamic time warping (Maeda et al. 2014, III-E)."""
