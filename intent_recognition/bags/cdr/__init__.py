# SPDX-License-Identifier: Apache-2.0
"""Decode CDR messages one by one or as whole columns."""
