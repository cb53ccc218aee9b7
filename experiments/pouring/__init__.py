# SPDX-License-Identifier: Apache-2.0
"""Pouring with containers never demonstrated (Brandl et al. 2014, Fig. 3-5)."""
