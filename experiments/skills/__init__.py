# SPDX-License-Identifier: Apache-2.0
"""Skills that grow: corrected by hand, practised."""
