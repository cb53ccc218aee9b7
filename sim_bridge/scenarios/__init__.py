# SPDX-License-Identifier: Apache-2.0
"""Scenes for recordings and experiments."""
