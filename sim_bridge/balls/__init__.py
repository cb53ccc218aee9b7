# SPDX-License-Identifier: Apache-2.0
"""Containers with balls for a fluid: tilting, pouring and catching, each in a world of its own."""
