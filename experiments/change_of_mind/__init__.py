# SPDX-License-Identifier: Apache-2.0
"""A worker who changes his mind in the middle of a reach."""
