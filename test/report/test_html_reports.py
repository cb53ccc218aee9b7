# SPDX-License-Identifier: Apache-2.0
"""The demo's and the evaluation's report: numbers equal the inputs, missing parts are left out."""

import base64
import re
from dataclasses import replace

import numpy as np
import pytest

from intent_recognition.evaluation.scoring import PREDICTION_NAMES
from intent_recognition.evaluation.session_summary import InteractionRecord, summarise
from intent_recognition.report import demo_page, drawing, fields_of
from intent_recognition.report.evaluation_report import evaluation_page, series
from intent_recognition.report.html import Figure, KeyNumbers, Row, TableBlock, render

pytestmark = pytest.mark.usefixtures("laid_out_roughly")
LABELS = ["hold_screwdriver", "plate_handover", "screw_handover", "none"]


def blocks_of(page, kind):
    return [block for section in page.sections for block in section.blocks if type(block) is kind]


def figures_of(page):
    rows = [figure for row in blocks_of(page, Row) for figure in row.figures]
    return rows + blocks_of(page, Figure)


def key_numbers(page):
    return {n.label: n for block in blocks_of(page, KeyNumbers) for n in block.numbers}


@pytest.fixture(scope="module")
def session():
    rng = np.random.default_rng(5)
    records, traces = [], []
    for index in range(1, 10):
        task = LABELS[index % 3]
        right = index != 5
        measured = {
            "observations": 40 + index, "decision_time_s": 0.4,
            "decision_share": 0.02 * index + 0.2, "hand_error_m": 0.01 + 0.001 * index,
            "arrival_s": 0.1 * index - 0.3,
        }  # fmt: skip
        values = measured if right else dict.fromkeys(measured)
        recognised = task if right else "none"
        records.append(InteractionRecord(index, task, recognised, movement_s=1.5, **values))
        share = np.linspace(0.0, 1.0, 20)
        p = rng.dirichlet(np.ones(4), 20)
        traces.append({"index": index, "labels": LABELS, "share": share, "probabilities": p})
    return records, traces


@pytest.fixture
def undrawn(monkeypatch):
    """Figures are made, but not written as SVG: for tests of what stands around them."""
    monkeypatch.setattr(drawing, "to_svg", lambda figure: b"<svg/>")


@pytest.fixture(scope="module")
def page(session):
    records, traces = session
    return demo_page(records, summarise(records), traces, {"seed": 1})


@pytest.mark.slow
def test_the_demo_report_needs_nothing_from_outside(page):
    html = render(page)
    drawings = re.findall(r"data:image/svg\+xml;base64,([\w+/=]+)", html)
    texts = [html, *(base64.b64decode(code).decode() for code in drawings)]
    found = [url for text in texts for url in re.findall(r"https?://[^\s\"'<>)]+", text)]
    assert {url for url in found if not url.startswith("http://www.w3.org/")} == set()
    sources = re.findall(r'(?:src|href)="([^"]{0,30})', html)
    assert sources
    assert all(source.startswith("data:image/") for source in sources)


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("wrong", [0, 2])
def test_the_report_of_several_people_counts_wrong_helps_and_does_not_judge_waiting(session, wrong):
    records = [replace(r, person=("anna", "ben")[r.index % 2]) for r in session[0]]
    records[1] = replace(records[1], wrong_helps=wrong)
    page = demo_page(records, summarise(records), session[1], {})
    assert "Helped with" in render(page) and "One person may wait" in render(page)
    assert page.title == "Toolbox assembly of anna and ben with one arm"
    numbers = key_numbers(page)
    assert (numbers["wrong helps"].ours, numbers["wrong helps"].good) == (str(wrong), not wrong)
    known = sum(r.believed == r.task for r in records)
    assert numbers["recognised at the end of the movement"].ours == f"{known}/{len(records)}"
    assert "median decision" not in numbers


def test_other_tasks_than_the_papers_are_not_compared_with_it(session, undrawn):
    records = [replace(record, task=f"other_{record.task}") for record in session[0]]
    page = demo_page(records, summarise(records), (), {})
    assert page.title == "Assembly with a simulated coworker"
    assert not any(number.paper for number in key_numbers(page).values())
    assert "Conditions differ" not in render(page)


def test_the_demo_table_is_the_records(session, page):
    records, _ = session
    table = blocks_of(page, TableBlock)[0]
    fields = fields_of(records)
    assert table.rows == tuple(tuple(f.cell(record) for f in fields) for record in records)
    assert table.marked == [4]


@pytest.mark.slow
def test_figures_without_data_are_left_out(session, page, undrawn):
    records, _ = session
    assert len(figures_of(page)) == 4 + 2 + 4
    assert len(figures_of(demo_page(records, summarise(records), (), {}))) == 4
    empty = {"transfer_s": None, "load_n": np.zeros(3), "share": [], "labels": LABELS}
    for more in ({}, empty):
        data = [{"index": r.index, **more} for r in records]
        assert len(figures_of(demo_page(records, summarise(records), data, {}))) == 4


def test_no_interaction_at_all_still_gives_a_page():
    assert "recognised 0/0" in render(demo_page([], summarise([]), (), {}))


def result(rng, unit="rad"):
    def one():
        value = float(rng.uniform(0.1, 0.3))
        return value if isinstance(unit, str) else {u: value * (i + 1) for i, u in enumerate(unit)}

    return {
        "n_demonstrations": 28,
        "tasks": ["rocket", "waving"],
        "unit": unit,
        "recognition": {
            phase: {
                f: {"accuracy": float(rng.uniform()), "log_loss": float(rng.uniform())}
                for f in ("0.1", "0.2", "0.3", "0.5", "0.7", "1.0")
            }
            for phase in ("known_phase", "unknown_phase")
        },
        "prediction": {
            phase: {f: {n: one() for n in PREDICTION_NAMES} for f in ("0.25", "0.5", "0.75", "1.0")}
            for phase in ("known_phase", "unknown_phase")
        },
    }


@pytest.mark.slow
def test_evaluation_tables_equal_the_json(rng, undrawn):
    content = result(rng)
    tables = blocks_of(evaluation_page(content, "t"), TableBlock)
    for row, fraction in zip(tables[0].rows, content["recognition"]["known_phase"], strict=True):
        known, unknown = (content["recognition"][p][fraction] for p in content["recognition"])
        assert row == (
            f"{100 * float(fraction):.0f}", f"{100 * known['accuracy']:.1f}",
            f"{known['log_loss']:.3f}", f"{100 * unknown['accuracy']:.1f}",
            f"{unknown['log_loss']:.3f}",
        )  # fmt: skip
    for table, phase in zip(tables[1:], ("known_phase", "unknown_phase"), strict=True):
        for row, scores in zip(table.rows, content["prediction"][phase].values(), strict=True):
            values = [float(cell) for cell in row[1:]]
            expected = [v * (100 if n == "coverage_2_sigma" else 1) for n, v in scores.items()]
            np.testing.assert_allclose(values, expected, rtol=0.006)


def test_what_the_nodes_would_have_done_and_what_was_left_out_are_tables(rng):
    row = {"n": 20, "recognised": 0.9, "acted_on": 0.55, "wrongly_acted_on": 0.0}
    online = {
        "known_phase": row | {"median_share_at_decision": None},
        "unknown_phase": row | {"median_share_at_decision": 0.204},
    }
    faults = {
        "left_out": [{"recording": "demo_3", "reason": "two clocks"}],
        "doubtful": [{"recording": "demo_4", "reason": "a hint"}],
    }
    page = evaluation_page({"online": online, **faults}, "t")
    nodes, left_out = blocks_of(page, TableBlock)
    assert [r[1:] for r in nodes.rows] == [
        ("18 of 20", "11 of 20", "0 of 20", None),
        ("18 of 20", "11 of 20", "0 of 20", "20"),
    ]
    assert left_out.rows == (("demo_3", "left out", "two clocks"), ("demo_4", "doubtful", "a hint"))


@pytest.mark.slow
def test_several_units_give_a_section_each(rng, undrawn):
    content = result(rng, ["rad", "m"])
    page = evaluation_page(content, "t")
    headings = [section.heading for section in page.sections]
    assert "Prediction of the controlled agent [rad]" in headings
    assert "Prediction of the controlled agent [m]" in headings
    table = content["prediction"]["known_phase"]
    assert series(table, "rmse", "m")[1] == [entry["rmse"]["m"] for entry in table.values()]


@pytest.mark.slow
def test_missing_parts_and_values_are_left_out(rng, undrawn):
    content = result(rng)
    content["prediction"]["known_phase"]["1.0"]["rmse_future"] = None
    assert blocks_of(evaluation_page(content, "t"), TableBlock)[1].rows[-1][3] is None
    for part in ("recognition", "prediction"):
        less = {key: value for key, value in content.items() if key != part}
        assert render(evaluation_page(less, "t"))
    assert render(evaluation_page({}, "Nothing"))


@pytest.mark.slow
def test_optional_parts_are_shown(rng):
    content = result(rng) | {
        "mixture": {"n_components": 4, "purity": 0.97},
        "reliability": {
            "known_phase": {"probability": [0.1, None], "share_true": [0.2, None], "count": [5, 0]}
        },
        "confusion": {
            "known_phase": {
                f: {"true": ["a", "b"], "recognised": ["a", "b", "none"], "counts": [[3, 0, 1]] * 2}
                for f in ("0.2", "0.5", "1.0")
            }
        },
        "none": {
            "n_known": 4,
            "n_unknown": 4,
            "area": 0.875,
            "roc": {"unknown": [0.0, 0.0, 0.5, 1.0], "known": [0.0, 0.75, 1.0, 1.0]},
            **{
                f"{what}_{kind}": 0.25
                for what in ("activated", "above_threshold")
                for kind in ("known", "unknown")
            },
            "left_out": {"a": {"n": 4, "area": None, "activated": 0.0, "above_threshold": 0.5}},
        },
    }
    page = evaluation_page(content, "t")
    assert key_numbers(page)["components chosen"].ours == "4"
    assert key_numbers(page)["area under the ROC"].ours == "0.875"
    new = 1 + 2 + 1  # reliability, two confusions, ROC
    assert len(figures_of(page)) == len(figures_of(evaluation_page(result(rng), "t"))) + new
    cells = [row for table in blocks_of(page, TableBlock) for row in table.rows]
    assert ("a", "4", None, "50.0", "0.0") in cells
    headings = [section.heading for section in page.sections]
    assert "Movements of unknown tasks" in headings
