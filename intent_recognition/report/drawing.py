# SPDX-License-Identifier: Apache-2.0
"""Blank figures in this project's style and their bytes; the only file that loads matplotlib.

Figures are not registered with pyplot, so that an unused figure is freed.
"""

import functools
from collections.abc import Callable, Iterable, Mapping
from io import BytesIO
from typing import TYPE_CHECKING, Any, Literal, ParamSpec, TypeAlias, TypeVar

from intent_recognition.array_types import Floats
from intent_recognition.errors import optional
from intent_recognition.promp import NONE
from intent_recognition.report import html

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.typing import LineStyleType

Look: TypeAlias = dict[str, Any]
"""Keyword arguments of matplotlib."""
Drawing: TypeAlias = "Figure"
"""A matplotlib Figure; matplotlib is loaded only when one is drawn."""
Panel: TypeAlias = "Axes"
"""Axes of a Drawing."""

NONE_COLOUR = "#8792a0"
INK = "#1d2733"
SOFT = "#5a6777"
PAPER_COLOUR = "#3d4856"

PALETTE = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#b58900", "#56b4e9", "#7a5195", "#8c564b")
"""Okabe and Ito's colours, distinct under common colour blindness; yellow is darkened."""

PREDICTED_COLOUR = "#b3123f"
"""Colour of predictions in figures without tasks' curves: a crimson that no task has."""

MARKERS = "os^Dv<>P"

DASHED: "LineStyleType" = (0, (4, 2))
"""Line style of references: true values, baselines, the paper's values."""

LAYOUT: Literal["constrained"] | None = "constrained"
"""Layout engine that places the panels."""

STYLE: dict[str, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 9.5,
    "text.color": INK,
    "text.parse_math": False,  # names may contain dollar signs
    "figure.constrained_layout.wspace": 0.06,  # last and first numbers of neighbours do not touch
    "figure.facecolor": "white",
    "axes.facecolor": "white",
    "axes.edgecolor": "#b6c0cb",
    "axes.linewidth": 0.8,
    "axes.labelcolor": INK,
    "axes.labelsize": 9.5,
    "axes.titlesize": 10,
    "axes.titlelocation": "left",
    "axes.titleweight": "bold",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e3e8ee",
    "grid.linewidth": 0.8,
    "xtick.color": SOFT,
    "ytick.color": SOFT,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.labelsize": 9,
    "ytick.labelsize": 9,
    "legend.frameon": False,
    "legend.fontsize": 9,
    "legend.columnspacing": 1.3,
    "legend.handlelength": 1.5,
    "legend.handletextpad": 0.6,
    "lines.linewidth": 1.8,
    "lines.solid_capstyle": "round",
    "path.simplify_threshold": 0.3,
    "svg.fonttype": "path",
    "svg.hashsalt": "intent_recognition",
}


P = ParamSpec("P")
T = TypeVar("T")


def styled(draw: Callable[P, T]) -> Callable[P, T]:
    """Run a drawing function in this project's style, whatever the user's settings."""

    @functools.wraps(draw)
    def run(*args: P.args, **kwargs: P.kwargs) -> T:
        matplotlib = optional("matplotlib")
        with matplotlib.rc_context():
            matplotlib.rcdefaults()
            with matplotlib.rc_context(STYLE):
                return draw(*args, **kwargs)

    return run


def new_figure(width_in: float, height_in: float) -> Drawing:
    """A blank matplotlib Figure of a size in inches, which needs no display."""
    Figure = optional("matplotlib.figure").Figure
    return Figure(figsize=(width_in, height_in), layout=LAYOUT)


def new_axes(width_in: float, height_in: float) -> tuple[Drawing, Panel]:
    """A blank figure of a size in inches, and its only panel."""
    figure = new_figure(width_in, height_in)
    return figure, figure.subplots()


@styled
def to_svg(figure: Drawing) -> bytes:
    """Render a figure as an SVG file; equal figures give equal bytes.

    The file contains no date and, except for XML namespaces, no address.
    """
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    stream = BytesIO()
    nothing = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    engine = figure.get_layout_engine()
    if engine is not None:  # else `savefig` would draw everything twice
        FigureCanvasSVG(figure)
        figure.dpi = 72  # resolution at which matplotlib measures SVG files
        engine.execute(figure)
        figure.set_layout_engine(None)
    figure.savefig(stream, format="svg", metadata=nothing)
    figure.set_layout_engine(engine)
    head, _, rest = stream.getvalue().partition(b"<!DOCTYPE")
    return head + rest.partition(b">")[2].lstrip() if rest else head


def svg_figure(figure: Drawing, caption: str) -> html.Figure:
    """A figure with its caption, as a block of a page."""
    return html.Figure(to_svg(figure), caption)


@styled
def to_png(figure: Drawing, dpi: float = 150.0) -> bytes:
    """Render a figure as a PNG file."""
    stream = BytesIO()
    figure.savefig(stream, format="png", dpi=dpi, metadata={"Software": None})
    return stream.getvalue()


def fill_two_sigma(
    axes: Panel,
    at: Floats,
    mean: Floats,
    std: Floats,
    colour: str,
    *,
    alpha: float = 0.18,
    label: str | None = None,
) -> None:
    """Shade two standard deviations on both sides of a mean; arrays (T,)."""
    low, high = mean - 2.0 * std, mean + 2.0 * std
    axes.fill_between(at, low, high, color=colour, alpha=alpha, linewidth=0, label=label)


def shared_legend(figure: Drawing, panels: Iterable[Panel], n_columns: int) -> None:
    """Draw one legend for several panels below the figure; shared entries appear once."""
    entries: dict[str, Artist] = {}
    for axes in panels:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    figure.legend(
        list(entries.values()), list(entries), loc="outside lower center", ncols=n_columns
    )


def task_colours(labels: Iterable[str], earlier: Mapping[str, str] | None = None) -> dict[str, str]:
    """One colour per label, equal wherever the same labels are drawn; `none` is grey.

    Args:
        labels: labels of all tasks.
        earlier: colours that tasks keep; the other tasks get the remaining colours.
    """
    tasks = sorted(set(labels) - {NONE, ""})
    colours = {task: earlier[task] for task in tasks if task in earlier} if earlier else {}
    for task in tasks:
        if task not in colours:
            colours[task] = min(PALETTE, key=list(colours.values()).count)
    return colours | {NONE: NONE_COLOUR}


def task_markers(labels: Iterable[str]) -> dict[str, str]:
    """One marker per label, so that colour is not the only difference."""
    tasks = sorted(set(labels) - {NONE, ""})
    return {task: MARKERS[i % len(MARKERS)] for i, task in enumerate(tasks)} | {NONE: "x"}


def readable(label: str) -> str:
    """A label with spaces instead of underscores."""
    return label.replace("_", " ") or NONE
