# SPDX-License-Identifier: Apache-2.0
"""The papers' experiments, each in a folder: study, figures, report; `intent experiments`."""
