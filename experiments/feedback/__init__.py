# SPDX-License-Identifier: Apache-2.0
"""The arm reproduces mean and variance of a primitive (Paraschos et al. 2013)."""
