# SPDX-License-Identifier: Apache-2.0
"""Prediction error of ProMP and DMP under noise (Maeda et al. 2014, Fig. 3)."""
