# SPDX-License-Identifier: Apache-2.0
"""The gallery's figures in this project's style; the examples themselves stay plain matplotlib."""

from cycler import cycler
from matplotlib import rcParams

from intent_recognition.report.drawing import PALETTE, STYLE


def apply(gallery_conf: dict, file_name: str) -> None:
    """Called by sphinx-gallery before each example."""
    rcParams.update(STYLE)
    rcParams["axes.prop_cycle"] = cycler(color=PALETTE)
    rcParams["figure.dpi"] = 110
