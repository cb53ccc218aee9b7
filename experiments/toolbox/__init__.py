# SPDX-License-Identifier: Apache-2.0
"""The toolbox assembly (Ewerton et al. 2015, Fig. 5-8)."""
