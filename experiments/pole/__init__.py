# SPDX-License-Identifier: Apache-2.0
"""Two ways around a pole (Ewerton et al. 2015, Fig. 2-4)."""
