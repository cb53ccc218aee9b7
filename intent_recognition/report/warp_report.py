# SPDX-License-Identifier: Apache-2.0
"""The report of one warp."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from intent_recognition.report import html
from intent_recognition.report.drawing import to_png, to_svg
from intent_recognition.report.figures_warping import cut_figure, parts_figure
from intent_recognition.warping import ObjectModel, PouringParameters, WarpedObject


def write_warp_report(
    path: str | Path,
    source: ObjectModel,
    warped: WarpedObject,
    parameters: PouringParameters,
    content: Mapping[str, object],
) -> Path:
    """Write the report of a warp as one HTML file."""
    own = source.annotated
    views = (
        (f"annotated: {own.name}", source.frame.to_local(own.points), own.labels),
        ("warped", warped.frame.to_local(warped.points), warped.labels),
    )
    parts = to_png(parts_figure(views))
    cut = to_svg(cut_figure(warped, parameters))
    degrees = np.degrees(parameters.tilt_reference_rad)
    numbers = (
        html.KeyNumber("opening radius", f"{1e3 * parameters.opening_radius_m:.1f} mm"),
        html.KeyNumber("volume", f"{1e6 * parameters.volume_m3:.0f} ml"),
        html.KeyNumber("height", f"{1e3 * parameters.height_m:.1f} mm"),
        html.KeyNumber("tilt that leaves half", f"{degrees:.1f}\N{DEGREE SIGN}"),
    )
    rows = tuple((name, _text(value)) for name, value in content.items())
    table = html.TableBlock(
        (html.Column("name", align="left"), html.Column("value", align="left")), rows
    )
    caption = (
        "Cut along the lip. The line is the fitted cavity; the dashed one is the level of what is"
        " left when the container is tilted about its lip until half of its volume is above it."
    )
    page = html.ReportPage(
        title="Warped object",
        subtitle=f"{content['source']} onto {content['target']}",
        sections=(
            html.Section("Parameters", (html.KeyNumbers(numbers),)),
            html.Section("Parts", (html.Figure(parts, "Points by part."),)),
            html.Section("Cavity", (html.Figure(cut, caption),)),
            html.Section("As JSON", (table,)),
        ),
    )
    return html.write_page(path, page)


def _text(value: object) -> str:
    """A JSON value in short."""
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list):
        return ", ".join(_text(one) for one in value)
    if isinstance(value, dict):
        return ", ".join(f"{key} {_text(one)}" for key, one in value.items())
    return str(value)
