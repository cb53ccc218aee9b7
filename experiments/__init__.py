# SPDX-License-Identifier: Apache-2.0
"""The papers' experiments, a folder each, with study, figures and report.

`intent experiments` runs them. `generate` simulates the recordings in bags/; `annotate` makes the
shipped annotated mug.
"""
