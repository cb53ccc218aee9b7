# SPDX-License-Identifier: Apache-2.0
"""Pouring balls from a cup in the arm's hand into a second container."""
