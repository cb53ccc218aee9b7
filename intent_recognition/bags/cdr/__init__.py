# SPDX-License-Identifier: Apache-2.0
"""CDR: messages as bytes, decoded one by one or by whole columns."""
