# SPDX-License-Identifier: Apache-2.0
"""Objects handed over by force: a cell in physics, and people who give and take."""
