# SPDX-License-Identifier: Apache-2.0
"""The toolbox without labels, on a subset."""

from dataclasses import replace

import numpy as np
import pytest

from experiments.draws import Draw, draw_again
from experiments.settings import Settings
from experiments.toolbox import experiment as toolbox
from experiments.toolbox import study as toolbox_study
from experiments.toolbox.report import findings

pytestmark = pytest.mark.slow  # the whole experiment runs first, in its quick form


@pytest.fixture(scope="module")
def study():
    return toolbox_study.investigate(Settings(quick=True))


@pytest.fixture(scope="module")
def outcome(study):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(toolbox, "investigate", lambda settings: study)
        return toolbox.run(Settings(quick=True))


def test_the_three_interactions_are_found_and_the_hand_is_as_exact_as_in_the_paper(outcome):
    assert outcome.numbers["chosen"] == 3
    assert outcome.numbers["purity"] == 1.0
    assert outcome.numbers["recognised_from_movement"] == 48
    errors, tasks = np.array(outcome.numbers["hand_error_m"]), np.array(outcome.numbers["tasks"])
    assert errors[tasks == "plate_handover"].mean() < 0.032
    assert errors[tasks == "hold_screwdriver"].mean() < 0.021
    assert 0.9 < outcome.numbers["inside_2_sigma"] < 0.99
    executions = outcome.numbers["executions"]
    assert len(executions) == toolbox_study.QUICK_EXECUTIONS == outcome.numbers["executions_right"]
    assert all(0.0 < e["decided_share"] < 1.0 for e in executions)


def test_the_hand_from_the_final_wrist_alone_stands_beside_it(outcome):
    """What the paper did: its regions of goals lie apart, ours overlap."""
    tasks, errors = np.array(outcome.numbers["tasks"]), outcome.numbers["hand_error_end_alone_m"]
    for task, paper_cm in (("plate_handover", "3.2 ± 2.6"), ("hold_screwdriver", "2.1 ± 2.3")):
        own = 100.0 * np.array(errors)[tasks == task]
        (row,) = [
            f
            for f in outcome.findings
            if task.replace("_", " ") in f.quantity and "from the final wrist alone" in f.quantity
        ]
        assert row.paper == paper_cm and row.ours.startswith(f"{own.mean():.1f} ± ")
        assert f"{outcome.numbers['recognised_from_end']} of 48" in row.remark


def test_recordings_drawn_again_are_told_by_the_same_numbers(outcome, shipped_again):
    """Were the shipped ones drawn again, their numbers would come out."""
    settings = Settings(quick=True, n_seeds=2)
    (draw,) = draw_again(
        settings,
        "toolbox",
        lambda folder: toolbox_study.numbers_of_draw(
            toolbox_study.leave_each_out(folder / "toolbox/train", settings)
        ),
        keep=lambda folder: "train" in folder.parts,
    )
    (shipped,) = outcome.numbers["draws"]
    assert {"seed": 1, **draw.numbers} == shipped and draw.seed == 2
    tasks = np.array(outcome.numbers["tasks"])
    plate = 100.0 * np.array(outcome.numbers["hand_error_m"])[tasks == "plate_handover"]
    np.testing.assert_allclose(draw.numbers["plate handover, whole"], plate.mean())


def test_draws_that_come_out_otherwise_say_why(study):
    """The shipped recordings give three components; those of another seed need not."""
    other = Draw(2, {**study.draws[0].numbers, "components": 4, "in their own": 47})
    missed = [
        one for one in findings(replace(study, draws=(*study.draws, other))) if one.holds is False
    ]
    assert {"There are three interactions.", "Some recordings lie between two components."} <= {
        one.remark for one in missed
    }
