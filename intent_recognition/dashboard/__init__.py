# SPDX-License-Identifier: Apache-2.0
"""The web page that shows the cell, replays recordings and teaches tasks.

Each tab and each thing in the scene has a file, and so have the checks of browsers and topics.
"""
