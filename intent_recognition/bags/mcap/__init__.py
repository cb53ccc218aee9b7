# SPDX-License-Identifier: Apache-2.0
"""Read MCAP files: their chunks and records, scanned past any damage."""
