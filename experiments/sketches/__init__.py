# SPDX-License-Identifier: Apache-2.0
"""Pairs of sketched curves: sparse observations and noise (Maeda et al. 2014, Fig. 2-3)."""
