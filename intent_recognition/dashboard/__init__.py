# SPDX-License-Identifier: Apache-2.0
"""The web page that shows the cell, replays recordings and teaches tasks."""
