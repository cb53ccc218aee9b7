# SPDX-License-Identifier: Apache-2.0
"""From raw tracker poses to trustworthy poses in the world frame."""
