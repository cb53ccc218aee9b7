# SPDX-License-Identifier: Apache-2.0
"""`intent explain`: the evidence of each decision, and what would have come of less."""

import io
import json
from dataclasses import replace

import numpy as np
import pytest
from cli.recorded import DOFS, TRUTH
from model_builder import (
    TOOL,
    WRIST,
    learned_model,
    make_dofs,
    perform,
    true_library,
    write_recording,
)
from rich.console import Console

from intent_recognition.bags import BagReader
from intent_recognition.cli.explain import print_explanation
from intent_recognition.demonstrations import Source, iter_samples
from intent_recognition.evaluation import explain, replay
from intent_recognition.promp import NONE
from intent_recognition.recognition import DecisionState, IntentEstimator, decide, decision_settings
from intent_recognition.report import task_colours
from intent_recognition.report.explanation_report import evidence_figure, heading, without_rows

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    recording = perform(TRUTH, 1, 50, rate_hz=25.0)
    return write_recording(tmp_path_factory.mktemp("bags") / "bag", recording, DOFS)


def test_the_decision_is_replays_and_its_odds_are_those_of_the_probabilities(bag):
    model = learned_model(DOFS, TRUTH)
    rows = list(replay(BagReader(bag), model))
    first = next(row for row in rows if row["active_task"])
    (found,) = explain(BagReader(bag), model)
    assert found.task == first["active_task"] == "task_1"
    assert found.onset_ns + round(found.after_s * 1e9) == first["stamp"]
    assert (found.evidence.task, found.evidence.rival) == ("task_1", "task_0")
    p = first["probabilities"]
    np.testing.assert_allclose(found.evidence.log_odds, np.log(p["task_1"] / p["task_0"]))


def test_without_a_dof_it_decides_as_on_a_recording_that_never_had_it(bag):
    model = learned_model(DOFS, TRUTH)
    (found,) = explain(BagReader(bag), model)
    names = model.library.observed_names
    assert list(found.without) == list(names)
    for k, name in enumerate(names):
        acted = next((stamp_ns, task) for stamp_ns, task in _decided(model, bag, k) if task)
        expected = (acted[1], (acted[0] - found.onset_ns) * 1e-9)
        assert tuple(found.without[name]) == expected


def _decided(model, bag, lost):
    """Stamp and active task after each observation, one DOF being NaN throughout."""
    estimator, state = IntentEstimator(model.library), DecisionState()
    settings = decision_settings(model.library)
    for source, one in iter_samples(BagReader(bag), model.dofs):
        if source is Source.CONTROLLED:
            estimator.update_controlled(one)
            continue
        values = one.values.copy()
        values[lost] = np.nan
        estimate = estimator.update(one._replace(values=values).measured())
        end_std = estimator.predicted_end_std()
        current = estimate.labels, estimate.probabilities
        state, task = decide(settings, state, *current, end_std, estimate.log_evidence)
        yield one.stamp_ns, task


def test_of_two_signals_with_equal_stamps_the_deciding_one_is_explained(tmp_path):
    dofs = make_dofs(WRIST, TOOL)
    truth = true_library(dofs, n_tasks=2)
    model = learned_model(dofs, truth)
    model = replace(model, library=replace(model.library, none_margin=4.0))
    bag = write_recording(tmp_path / "bag", perform(truth, 1, 103, rate_hz=25.0), dofs)
    rows = list(replay(BagReader(bag), model))
    decided = next(k for k, row in enumerate(rows) if row["active_task"])
    before, first = rows[decided - 1 : decided + 1]
    of_first, of_second = (
        np.log(row["probabilities"]["task_1"] / row["probabilities"]["task_0"])
        for row in (before, first)
    )
    counted = model.library.task_evidence  # one nat of evidence, as far as it counts
    assert before["stamp"] == first["stamp"] and abs(of_first - of_second) > counted
    one, *_ = explain(BagReader(bag), model)
    np.testing.assert_allclose(one.evidence.log_odds, of_second)
    assert [*one.without][-2:] == [WRIST.topic, TOOL.topic]


def test_tables_json_and_page_say_the_same(run_command, model, bag, tmp_path):
    out, page = tmp_path / "why.json", tmp_path / "why.html"
    code, text = run_command("explain", bag, "--model", model, "--json", out, "--report", page)
    assert code == 0
    (one,) = json.loads(out.read_text())
    total = one["expected"] + sum(map(sum, one["evidence"].values()))
    assert total == pytest.approx(one["log_odds"])
    for shown in (text, page.read_text()):
        assert f"task 1 rather than task 0, {one['after_s']:.2f} s after onset" in shown
    assert f"{one['log_odds']:+.1f}" in text
    assert page.read_text().count("data:image/svg+xml") == 2


def test_the_end_of_a_signal_s_name_is_not_cut(bag):
    (one,) = explain(BagReader(bag), learned_model(DOFS, TRUTH))
    one.evidence.by_dof[0] = -0.01
    print_explanation(Console(width=80, file=(text := io.StringIO())), one)
    cells = [line.split("│")[1].strip() for line in text.getvalue().splitlines() if "│" in line]
    assert {name[-4:] for name in one.evidence.names} <= {cell[-4:] for cell in cells}
    assert "-0.0" not in text.getvalue()
    one.evidence.by_dof[:] = -1e-6
    assert {str(total) for _, total, _ in without_rows(one) if total is not None} == {"0.0"}
    shown = {line.get_color() for line in evidence_figure(one).axes[0].lines}
    assert not shown & set(task_colours(one.labels).values())  # those are on the same page


def test_replay_writes_the_same_page(run_command, model, bag, tmp_path):
    page = tmp_path / "replay.html"
    code, _ = run_command("replay", bag, "--model", model, "--report", page)
    assert code == 0
    assert "task 1 rather than task 0" in page.read_text()


def test_a_movement_without_a_decision_is_explained_where_it_came_nearest(tmp_path):
    model, stranger = learned_model(DOFS, TRUTH), true_library(DOFS, n_tasks=2, seed=78)
    bag = write_recording(tmp_path / "bag", perform(stranger, 0, 3, rate_hz=25.0), DOFS)
    assert not any(row["active_task"] for row in replay(BagReader(bag), model))
    found = explain(BagReader(bag), model)
    assert found
    for one in found:
        assert one.task == ""
        best = one.probabilities[:, :-1].max(axis=1)
        k = int(np.argmin(np.abs(one.times_s - one.after_s)))
        assert best[k] == best.max()
        others = dict(zip(one.labels, one.probabilities[k], strict=True))
        del others[one.evidence.task]
        assert one.evidence.rival == max(others, key=others.get) == NONE
        assert "rather than none" in heading(one)
