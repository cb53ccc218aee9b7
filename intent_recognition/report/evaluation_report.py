# SPDX-License-Identifier: Apache-2.0
"""The report of `intent evaluate`: its numbers as tables and figures."""

from collections.abc import Mapping

import numpy as np

from intent_recognition.evaluation import remarks_on
from intent_recognition.report import html
from intent_recognition.report.calibration_report import (
    by_phase,
    confusion_section,
    none_section,
    reliability_figures,
)
from intent_recognition.report.drawing import svg_figure
from intent_recognition.report.figures_evaluation import (
    PHASE_NAMES,
    RMSE_STYLES,
    coverage_figure,
    recognition_figure,
    rmse_figure,
)

PREDICTION_COLUMNS = {
    "rmse": "RMSE",
    "rmse_inferred_task": "RMSE, inferred task",
    "rmse_future": "RMSE, not yet seen",
    "rmse_mean_of_task": "mean of task",
    "rmse_nearest_neighbour": "nearest neighbour",
    "end_rmse": "RMSE of the end",
    "coverage_2_sigma": "inside 2 sigma",
    "nll": "neg. log likelihood",
}
ONLINE_COLUMNS = {
    "recognised": "recognised",
    "acted_on": "acted on",
    "wrongly_acted_on": "wrongly acted on",
    "median_share_at_decision": "of the movement at the decision, median",
}
ONLINE_EXPLANATION = (
    "Every recording is fed to the estimator and the decision that the nodes run, with their"
    " default settings, learned from the movements alone; recordings that are left out in turn are"
    " left out in at most ten folds. Unknown phase: the onset is detected and the duration"
    " inferred; known phase: both are given. The share at the decision is of the movement."
)
WITHOUT_UNIT = {"coverage_2_sigma": "%", "nll": "nat"}
EXPLANATION = (
    "No recording is scored by a library that learned from it. Known phase: start and end of the"
    " {segment} are given; unknown phase: only its start, speed and progress are inferred."
    " RMSE is the root mean square error of the controlled agent over the whole {segment}, averaged"
    " over recordings; baselines know the true task."
)


def evaluation_page(result: Mapping, title: str) -> html.ReportPage:
    """The report of the JSON of `intent evaluate`; missing parts are left out."""
    tasks = ", ".join(str(task) for task in result.get("tasks", ()))
    segment = result.get("segment", "movement")
    explained = " ".join([*remarks_on(result), EXPLANATION.format(segment=segment)])
    remark = html.Paragraph(explained, small=True)
    sections = [
        html.Section("Result", (_key_numbers(result, segment), remark)),
        html.Section("Recognition", _recognition(result.get("recognition", {}), segment)),
        confusion_section(result, segment),
        *(_prediction(result.get("prediction", {}), unit, segment) for unit in _units(result)),
        html.Section("Online", _online(result.get("online", {}))),
        html.Section("Calibration", _calibration(result, segment)),
        none_section(result),
        html.Section("Without labels", _mixture(result.get("mixture", {}))),
        html.Section("Left out and doubtful", _faults(result)),
    ]
    subtitle = f"{result.get('n_demonstrations', 0)} recordings of {tasks or 'no task'}"
    return html.ReportPage(title, subtitle, tuple(sections))


def number(value: object, unit: str) -> float:
    """A number of the JSON, for one unit if there are several; NaN if it is missing."""
    if isinstance(value, Mapping):
        value = value.get(unit)
    return float("nan") if value is None else float(value)  # type: ignore[arg-type]  # from JSON


def series(table: Mapping, name: str, unit: str = "") -> tuple[list[float], list[float]]:
    """Fractions in order, and the value of `name` at each fraction."""
    ordered = sorted(table, key=float)
    return [float(f) for f in ordered], [number(table[f].get(name), unit) for f in ordered]


def _units(result: Mapping) -> list[str]:
    unit = result.get("unit", "")
    return [unit] if isinstance(unit, str) else list(unit)


def _key_numbers(result: Mapping, segment: str) -> html.KeyNumbers:
    numbers = []
    for phase, name in PHASE_NAMES.items():
        early = result.get("recognition", {}).get(phase, {}).get("0.3")
        if early:
            text = f"{100 * number(early.get('accuracy'), ''):.0f} %"
            numbers.append(html.KeyNumber(f"recognised at 30 % of the {segment}", text, note=name))
    for phase, name in PHASE_NAMES.items():
        half = result.get("prediction", {}).get(phase, {}).get("0.5")
        for unit in _units(result) if half else ():
            ours = number(half.get("rmse"), unit)
            baselines = ("rmse_mean_of_task", "rmse_nearest_neighbour")
            best = np.nanmin([*(number(half.get(b), unit) for b in baselines), np.inf])
            good = bool(ours <= best) if np.isfinite(best) else None
            note = f"{name}; better baseline {_text(best)} {unit}" if good is not None else name
            label = f"RMSE at 50 % of the {segment}"
            numbers.append(html.KeyNumber(label, f"{_text(ours)} {unit}", good=good, note=note))
    return html.KeyNumbers(tuple(numbers))


def _recognition(recognition: Mapping, segment: str) -> tuple[html.Block, ...]:
    phases = by_phase(recognition)
    if not phases:
        return ()
    figure = recognition_figure(
        {phase: series(table, "accuracy") for phase, table in phases.items()},
        {phase: series(table, "log_loss") for phase, table in phases.items()},
        segment,
    )
    columns = [html.Column(f"{segment} observed", "%", form=".0f")]
    for phase in phases:
        columns.append(html.Column(f"accuracy, {PHASE_NAMES[phase]}", "%", form=".1f"))
        columns.append(html.Column(f"log loss, {PHASE_NAMES[phase]}", "nat", form=".3f"))
    rows = []
    for fraction in sorted(next(iter(phases.values())), key=float):
        row = [100 * float(fraction)]
        for table in phases.values():
            scores = table.get(fraction, {})
            row += [100 * number(scores.get("accuracy"), ""), number(scores.get("log_loss"), "")]
        rows.append(row)
    caption = f"Accuracy and mean log loss over the share of the {segment} observed."
    return svg_figure(figure, caption), html.TableBlock(columns, rows)


def _prediction(prediction: Mapping, unit: str, segment: str) -> html.Section:
    phases = by_phase(prediction)
    heading = f"Prediction of the controlled agent [{unit}]" if unit else "Prediction"
    if not phases:
        return html.Section(heading, ())
    panels = {
        phase: {name: series(table, name, unit) for name in RMSE_STYLES}
        for phase, table in phases.items()
    }
    caption = "Solid and dotted: the library; dashed: baselines, which are given the true task."
    figure = svg_figure(rmse_figure(panels, unit, segment), caption)
    tables = (_prediction_table(t, unit, segment, PHASE_NAMES[p]) for p, t in phases.items())
    return html.Section(heading, (figure, *tables))


def _prediction_table(table: Mapping, unit: str, segment: str, caption: str) -> html.TableBlock:
    columns = [html.Column(f"{segment} observed", "%")]
    columns += [html.Column(t, WITHOUT_UNIT.get(n, unit)) for n, t in PREDICTION_COLUMNS.items()]
    rows = []
    for fraction in sorted(table, key=float):
        values = {n: number(table[fraction].get(n), unit) for n in PREDICTION_COLUMNS}
        values["coverage_2_sigma"] *= 100
        texts = (_text(v, ".1f" if n == "coverage_2_sigma" else "") for n, v in values.items())
        rows.append((f"{100 * float(fraction):.0f}", *texts))
    return html.TableBlock(tuple(columns), tuple(rows), caption[0].upper() + caption[1:])


def _online(online: Mapping) -> tuple[html.Block, ...]:
    """Table of what the nodes would have done, as shares of the recordings."""
    phases = by_phase(online)
    if not phases:
        return ()
    *counts, share = ONLINE_COLUMNS
    rows = []
    for phase, scores in phases.items():
        n = scores["n"]
        values = (f"{round(n * scores[name])} of {n}" for name in counts)
        rows.append((PHASE_NAMES[phase], *values, 100 * number(scores[share], "")))
    columns = [html.Column(ONLINE_COLUMNS[name]) for name in counts]
    last = html.Column(ONLINE_COLUMNS[share], "%", form=".0f")
    table = html.TableBlock((*html.text_columns(""), *columns, last), rows)
    return table, html.Paragraph(ONLINE_EXPLANATION, small=True)


def _faults(result: Mapping) -> tuple[html.Block, ...]:
    rows = [
        (str(one["recording"]), kind, str(one["reason"]))
        for key, kind in (("left_out", "left out"), ("doubtful", "doubtful"))
        for one in result.get(key, ())
    ]
    columns = html.text_columns("recording", "", "why")
    return (html.TableBlock(columns, rows),) if rows else ()


def _calibration(result: Mapping, segment: str) -> tuple[html.Block, ...]:
    drawn = []
    prediction = result.get("prediction", {})
    units = _units(result)
    for unit in units:
        coverage = {
            phase: series(table, "coverage_2_sigma", unit)
            for phase, table in by_phase(prediction).items()
        }
        if coverage:
            where = f" ({unit})" if len(units) > 1 else ""
            caption = f"Share of true values within two standard deviations{where}."
            drawn.append(svg_figure(coverage_figure(coverage, segment), caption))
    drawn += reliability_figures(result)
    return tuple(html.Row(tuple(drawn[i : i + 2])) for i in range(0, len(drawn), 2))


def _mixture(mixture: Mapping) -> tuple[html.Block, ...]:
    if not mixture:
        return ()
    components = html.KeyNumber("components chosen", str(mixture.get("n_components", "?")))
    text = _text(number(mixture.get("purity"), ""), ".2f") or "?"
    purity = html.KeyNumber("purity", text, note="against the labels")
    return (html.KeyNumbers((components, purity)),)


def _text(value: float, form: str = "") -> str | None:
    """A number with three significant digits or in `form`; None if it is not known."""
    if not np.isfinite(value):
        return None
    decimals = 2 - int(np.floor(np.log10(abs(value)))) if value else 2
    return format(value, form or f".{min(max(decimals, 0), 6)}f")
