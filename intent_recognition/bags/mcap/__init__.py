# SPDX-License-Identifier: Apache-2.0
"""MCAP files: chunks, records, and a scan that passes damage."""
