# SPDX-License-Identifier: Apache-2.0
"""The arm points where the human points (Maeda et al. 2014, Fig. 4-6)."""
