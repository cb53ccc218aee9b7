# SPDX-License-Identifier: Apache-2.0
"""Two humans assemble a box; the arm takes one's place (Maeda et al. 2014, Fig. 7-9)."""
