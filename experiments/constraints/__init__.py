# SPDX-License-Identifier: Apache-2.0
"""Task constraints that carry over to other containers (Brandl et al. 2014, Fig. 3)."""
