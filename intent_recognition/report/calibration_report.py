# SPDX-License-Identifier: Apache-2.0
"""The evaluation report's sections on calibration, confusions and unknown movements."""

from collections.abc import Mapping

import numpy as np

from intent_recognition.report import html
from intent_recognition.report.drawing import readable, svg_figure
from intent_recognition.report.figures_evaluation import (
    PHASE_NAMES,
    confusion_shares_figure,
    reliability_figure,
    roc_figure,
)

UNKNOWN_EXPLANATION = (
    "Each task is left out in turn, and a library of the others sees its movements with unknown"
    " progress, as the nodes would. Known movements are seen by libraries learned without them. A"
    " movement reaches a threshold when the odds of one task against all else stay above it for as"
    " many consecutive observations as the decision asks for. Recognised: the default decision"
    " would act on it if the end were certain. Held back: recognised, but the end never is certain"
    " enough."
)


def reliability_figures(result: Mapping) -> list[html.Figure]:
    """A reliability diagram for each kind of phase."""
    figures = []
    for phase, bins in by_phase(result.get("reliability")).items():
        said, true = (np.array(bins[name], dtype=float) for name in ("probability", "share_true"))
        figure = reliability_figure(said, true, np.array(bins["count"]))
        caption = f"Are the task probabilities calibrated? {PHASE_NAMES[phase].capitalize()}."
        figures.append(svg_figure(figure, caption))
    return figures


def confusion_section(result: Mapping, segment: str) -> html.Section:
    """Confusion matrices early in the `segment` (movement or recording); mistakes at its end."""
    rows: list[html.Block] = []
    for phase, by_fraction in by_phase(result.get("confusion")).items():
        figures = []
        for fraction in [one for one in ("0.2", "0.5") if one in by_fraction]:
            table = by_fraction[fraction]
            figure = confusion_shares_figure(table["counts"], table["true"], table["recognised"])
            percent = f"{100 * float(fraction):.0f} %"
            caption = f"{percent} of the {segment} observed, {PHASE_NAMES[phase]}."
            figures.append(svg_figure(figure, caption))
        if figures:
            rows.append(html.Row(tuple(figures)))
    mistaken = [tuple(map(str, one.values())) for one in result.get("mistaken", ())]
    if mistaken:
        columns = html.text_columns("recording", "task", "taken for")
        caption = "Taken for another task with all observed, unknown phase: are the labels right?"
        rows.append(html.TableBlock(columns, tuple(mistaken), caption))
    return html.Section("Confusions", tuple(rows))


def none_section(result: Mapping) -> html.Section:
    """Recognition of movements of unknown tasks, if it was scored."""
    none, blocks = result.get("none") or {}, tuple[html.Block, ...]()
    if none.get("area") is not None:
        curve = none["roc"]
        figure = roc_figure(curve["unknown"], curve["known"], none["area"])
        caption = "Each point is a threshold: how many known and unknown movements reach it."
        explained = html.Paragraph(UNKNOWN_EXPLANATION, small=True)
        table = _left_out_table(none["left_out"])
        blocks = (_none_numbers(none), svg_figure(figure, caption), table, explained)
    return html.Section("Movements of unknown tasks", blocks)


def _none_numbers(none: Mapping) -> html.KeyNumbers:
    area = html.KeyNumber("area under the ROC", f"{none['area']:.3f}", good=none["area"] >= 0.95)
    activated = (
        html.KeyNumber(f"{kind} movements activated", text, note=_gates(none, kind))
        for kind in ("unknown", "known")
        for text in [_percent(none[f"activated_{kind}"])]
    )
    return html.KeyNumbers((area, *activated))


def _gates(none: Mapping, kind: str) -> str:
    """Shares of movements that pass each condition of the decision."""
    text = f"{_percent(none[f'above_threshold_{kind}'])} above the threshold"
    if none.get(f"recognised_{kind}") is None:
        return text
    recognised, held = (_percent(none[f"{part}_{kind}"]) for part in ("recognised", "held_back"))
    return f"{text}, {recognised} recognised, {held} held back by an uncertain end"


def _left_out_table(left_out: Mapping) -> html.TableBlock:
    columns = (
        html.Column("task left out", align="left"),
        html.Column("movements"),
        html.Column("area", form=".3f"),
        html.Column("above the threshold", "%", form=".1f"),
        html.Column("activated", "%", form=".1f"),
    )
    rows = []
    for task, own in left_out.items():
        shares = 100 * own["above_threshold"], 100 * own["activated"]
        rows.append((readable(task), own["n"], own["area"], *shares))
    return html.TableBlock(columns, rows, "Each task left out")


def by_phase(content: Mapping | None) -> dict[str, Mapping]:
    """Content by kind of phase, in order, without missing kinds."""
    return {phase: content[phase] for phase in PHASE_NAMES if content and content.get(phase)}


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100 * share:.0f} %"
