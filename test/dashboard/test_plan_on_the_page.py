# SPDX-License-Identifier: Apache-2.0
"""The plan of a cell for two people in a real browser: a step is forgotten, undone and saved."""

import os

import pytest
from dashboard.browser import chromium, free_port, visitor
from ros_harness import NodeProcess

from intent_recognition.plans import read_plan
from intent_recognition.share import share_path

pytestmark = pytest.mark.slow

LAST, BEFORE = "fasten handle", "after fasten 5, plate 6"
"""The last step, and what the one before waits for, as the page tells it."""
N_STEPS = 20


def steps(plan):
    """Names of a saved plan's steps."""
    return read_plan(plan.read_text(encoding="utf-8")).names


@pytest.fixture
def page(tmp_path, toolbox_model):
    """An estimator of two people with a plan of its own, the page, and its port."""
    chromium()
    plan, port = tmp_path / "plan.yaml", free_port()
    plan.write_text(share_path("config/examples/cell_plan.yaml").read_text(encoding="utf-8"))
    people = ["-p", "persons:=[anna, ben]"]
    nodes = {
        "nodes.intent_estimator": [*people, "-p", f"model:={toolbox_model}", "-p", f"plan:={plan}"],
        "dashboard.node": ["-p", f"port:={port}", "-p", "scene:=cell"],
    }
    made = [
        NodeProcess(f"intent_recognition.{module}", "--ros-args", *arguments)
        for module, arguments in nodes.items()
    ]
    try:
        yield plan, port
    finally:
        codes = [process.stop() for process in made]
    assert codes == [0, 0]


def test_a_step_is_forgotten_undone_and_the_plan_saved(page):
    plan, port = page
    with visitor() as person:
        person.open(port)
        person.wait_for("Plan of the assembly")
        person.page.get_by_text("Change the plan").click()
        forget = person.page.get_by_role("button", name="Forget", exact=True)
        forget.click()  # the last step, which is chosen at first
        person.wait_until(lambda: LAST not in person.text(), "the step is gone")
        person.press("Undo")
        person.wait_for(LAST)
        forget.click()  # of the one before, which is chosen since that one was gone
        person.wait_until(lambda: BEFORE not in person.text(), "the step is gone")
        person.press("Save")
        person.wait_until(lambda: len(steps(plan)) == N_STEPS - 1, "it is saved")
        if os.environ.get("SCREENSHOTS"):
            person.screenshot(path=f"{os.environ['SCREENSHOTS']}/plan.png")
    assert LAST in steps(plan) and "handle" not in steps(plan)
