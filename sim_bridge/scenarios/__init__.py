# SPDX-License-Identifier: Apache-2.0
"""The scenes that are recorded and experimented on."""
