# SPDX-License-Identifier: Apache-2.0
"""Few, asynchronous, noisy observations (Maeda et al. 2014, Fig. 2)."""
