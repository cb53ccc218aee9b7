# SPDX-License-Identifier: Apache-2.0
"""The web page that shows the cell, replays recordings and teaches tasks.

A file for each tab, for each thing in the scene, and for what is checked of browsers and topics.
"""
