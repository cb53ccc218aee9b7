# SPDX-License-Identifier: Apache-2.0
"""The papers' experiments, each in a folder: study, figures, report; `intent experiments`.

`generate` simulates the recordings in bags/, by the `recordings` of a folder; `annotate` makes the
shipped annotated mug.
"""
