# SPDX-License-Identifier: Apache-2.0
"""Boxes in the arm's way: does it keep clear, and what does that cost?"""
