# SPDX-License-Identifier: Apache-2.0
"""Explanations of decisions: evidence over time and by DOF, and decisions without signals."""

from collections.abc import Sequence

import numpy as np

from intent_recognition.evaluation import Explanation
from intent_recognition.report import html
from intent_recognition.report.drawing import (
    INK,
    PALETTE,
    SOFT,
    Drawing,
    new_figure,
    readable,
    styled,
    svg_figure,
)
from intent_recognition.report.figures_interaction import POSTERIOR, posterior_over_time_figure

EXPLANATION = (
    "Evidence is the logarithm of how much more probable an observation is under the task than"
    " under the other one (nats; 2.3 are a factor of ten, above zero speaks for the task). It adds"
    " up over time and over DOFs, each given those before it, to the odds that were acted on."
    " Without a signal, the estimator and the decision run over the recording again."
)
CAPTIONS = (
    "Left: evidence so far, in all and by DOF. Right: what each added until then, and what the odds"
    " were before.",
    POSTERIOR,
)


def explanation_page(explanations: Sequence[Explanation], title: str) -> html.ReportPage:
    """The report of the explanations of a recording."""
    sections = tuple(html.Section(heading(one), _blocks(one)) for one in explanations)
    return html.ReportPage(title, EXPLANATION, sections)


def heading(one: Explanation) -> str:
    """The decision and its time, in words."""
    after = f"{one.after_s:.2f} s after onset"
    decided = "" if one.task else "no decision; nearest to it with "
    task, rival = readable(one.evidence.task), readable(one.evidence.rival)
    return f"{decided}{task} rather than {rival}, {after}"


def without_rows(one: Explanation) -> list[tuple[str, float | None, str]]:
    """For each name, its evidence to a tenth of a nat, and the decision without it."""
    in_all = np.round(one.evidence.by_dof.sum(axis=0), 1) + 0.0  # not -0.0
    by_dof = dict(zip(one.evidence.names, in_all, strict=True))
    names = dict.fromkeys([*by_dof, *one.without])
    rows = []
    for name in names:
        instead, text = one.without.get(name), "-"
        if instead is not None:
            text = "no decision"
            if instead.after_s is not None:
                text = f"{readable(instead.task)} after {instead.after_s:.2f} s"
        rows.append((name, by_dof.get(name), text))
    return rows


@styled
def evidence_figure(one: Explanation) -> Drawing:
    """Figure of the accumulated evidence over time, by DOF and in total, and its final values."""
    found = one.evidence
    figure = new_figure(8.6, 3.4)
    over_time, in_all = figure.subplots(1, 2, width_ratios=(2, 1))
    sums = np.cumsum(found.by_dof, axis=0)
    colours = [PALETTE[(k + 3) % len(PALETTE)] for k in range(len(found.names))]  # not the tasks'
    short = [short_name(name, found.names) for name in found.names]
    for name, colour, column in zip(short, colours, sums.T, strict=True):
        over_time.plot(found.times_s, column, color=colour, label=name)
    total = found.expected + sums.sum(axis=1)
    over_time.plot(found.times_s, total, color=INK, linewidth=2.4, label="log odds")
    over_time.axhline(0.0, color=SOFT, linewidth=0.8)
    over_time.set(xlabel="time after onset [s]", ylabel="evidence [nat]")
    over_time.set_title(f"{readable(found.task)} against {readable(found.rival)}")
    in_all.barh(["before", *short], [found.expected, *sums[-1]], color=[SOFT, *colours])
    in_all.axvline(0.0, color=SOFT, linewidth=0.8)
    in_all.invert_yaxis()
    in_all.set(xlabel="evidence [nat]", title=f"log odds {found.log_odds:.1f}")
    figure.legend(*over_time.get_legend_handles_labels(), loc="outside lower center", ncols=6)
    return figure


def short_name(name: str, names: Sequence[str]) -> str:
    """A DOF's name without the prefix, up to a point, that all names share."""
    stems = {one.rpartition(".")[0] for one in names}
    return name.rpartition(".")[2] if len(stems) == 1 and len(names) > 1 else name


def _blocks(one: Explanation) -> tuple[html.Block, ...]:
    movement_s = max(float(one.times_s[-1]), 1e-9)
    trace = {
        "labels": one.labels,
        "share": one.times_s / movement_s,
        "probabilities": one.probabilities,
        "decision_s": one.after_s if one.task else None,
    }
    drawn = (evidence_figure(one), posterior_over_time_figure(trace, movement_s))
    columns = (
        html.Column("signal", align="left"),
        html.Column("evidence", "nat", form=".1f"),
        html.Column("without it", align="left"),
    )
    table = html.TableBlock(columns, without_rows(one))
    blocks: tuple[html.Block, ...] = (*map(svg_figure, drawn, CAPTIONS), table)
    if not one.task:
        blocks = (html.Paragraph("Nothing became active during this movement."), *blocks)
    return blocks
