# SPDX-License-Identifier: Apache-2.0
"""Warped parameters: what one annotated object tells about the next."""
