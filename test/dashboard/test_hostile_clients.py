# SPDX-License-Identifier: Apache-2.0
"""Browsers that mean harm, against a running node: what they may not do has no effect at all."""

import numpy as np
import pytest
from dashboard.guarded import eventually, send, update
from dashboard.hostile_graph import SAVE, TASK, Graph, Visit, drag, grab, leave

from intent_recognition.dashboard import admission
from intent_recognition.dashboard.cell import SkillRow
from intent_recognition.dashboard.teach_tab import BY_HAND
from intent_recognition.kinematics import LWR_LIMITS
from intent_recognition.nodes.conversions import position_array, trajectory_arrays
from intent_recognition.plans import read_plan
from sim_bridge.arm.trajectory_command import TrajectoryCommand

pytestmark = pytest.mark.slow

VIA, WRIST, HAND = "/via/handle", "/direct/wrist", "/direct/hand"
CLICKS, FEW = 600, 5


@pytest.fixture
def visit(harness, monkeypatch):
    made = []

    def start(begin=True, **values):
        made.append(Graph(harness, **values))
        if begin:
            made[-1].begin()
        return Visit(made[-1], monkeypatch), made[-1]

    return start


def every_action(page):
    """Whatever the newer controls can be asked for."""
    skills, via, teach, plan = page._skills, page._via, page._teach, page._watch._plan
    presses = (skills._keep, skills._undo, via._remove, plan._save)
    presses += (teach._record, teach._learn, teach._reach, teach._undo)
    values = (
        (skills._thumbs, "Bad"),
        (plan._change, "Forget"),
        (plan._wait, "Must wait"),
        (plan._step, "base"),
        (via._phase, 0.9),
        (via._std, 5.0),
        (via._chosen, "none"),
        (teach._task, "mine"),
        (teach._how, BY_HAND),
        (teach._take, True),
        (teach._wrist_goal, [0.1, 0.2, 0.3]),
        (teach._length, 1.0),
    )
    yield from (update(button, True) for button in presses)
    yield from (update(control, value) for control, value in values)
    for name in (VIA, WRIST, HAND, "/goals/hand"):
        yield from (grab(name), drag(name), leave(name))
    yield update(via._drag, False)


def test_nobody_changes_a_page_that_is_read_only(visit):
    visit, graph = visit(read_only=True)
    before = graph.controls()

    async def story(only):
        await visit.say(only, *every_action(graph.page))
        graph.page.show_message(True, "all was judged")
        await visit.until(lambda: "all was judged" in graph.page._banner.content)
        assert graph.controls() == before
        assert not graph.heard

    visit.run(story)


def test_what_is_hidden_or_disabled_cannot_be_pressed_or_dragged(visit):
    visit, graph = visit(begin=False)
    page = graph.page
    shown = [page._skills._keep, page._skills._undo, page._teach._record, page._teach._undo]
    assert [control.disabled for control in shown] == [False, False, True, False]

    async def story(operator):
        hidden = (page._teach._record, page._teach._learn, page._teach._reach, page._via._remove)
        await visit.say(operator, *(update(button, True) for button in hidden))
        await visit.say(operator, update(page._skills._thumbs, "Good"))
        for name in (VIA, WRIST, HAND):
            await visit.say(operator, grab(name), drag(name), leave(name), leave(name))
        graph.begin()
        await visit.like(operator)

    visit.run(story)
    page._state.skills = {TASK: [SkillRow("begun", {})]}
    undo = (page._skills._undo, page._teach._undo)
    graph.harness.spin_until(lambda: all(button.disabled for button in undo))


def malformed(page):
    """What no control and no handle of the page sends."""
    skills, via, teach, plan = page._skills, page._via, page._teach, page._watch._plan
    nan, inf = float("nan"), float("inf")
    numbers = (nan, inf, 1e300, "nan", "inf", "1e999", "x", None, [], [0.5], {}, {"nan": 1}, True)
    yield from (
        update(field, v) for field in (via._phase, via._std, teach._length) for v in numbers
    )
    vectors = ([1.0, 2.0], [1.0] * 4, [nan] * 3, [1e300] * 3, "123", "12", {}, None, {"nan": 1}, [])
    yield from (update(teach._wrist_goal, value) for value in vectors)
    for text in (3, None, ["a"], {"a": 1}, True, "x" * 5000, 1.5, b"bytes"):
        yield update(teach._task, text)
        yield update(via._chosen, text)
        yield update(skills._thumbs, text)
        yield from (update(field, text) for field in (plan._step, plan._change, plan._wait))
    for text in ("", "\x1b[2J", "<script>alert(1)</script>", "Middling"):
        yield from (update(choice, text) for choice in (skills._thumbs, via._chosen, plan._step))
    for button in (skills._keep, skills._undo, via._remove, via._drag, teach._take):
        yield from (update(button, value) for value in (3, "yes", None, [], {}, [1.0] * 3))
    for prop in ("visible", "disabled", "order", "label", "options", "update_cb", "removed"):
        yield update(skills._undo, True, updates={prop: False})
        yield update(skills._undo, True, updates={"value": True, prop: False})
    for uuid in (None, 3, [], {}, ["a"], "nobody", "x" * 5000):
        yield update(skills._undo, True, uuid=uuid)
    yield update(skills._undo, True, excluded_self_client=1)
    yield {"type": "GuiUpdateMessage"}
    for place in ((0.1, 0.2), (0.1,) * 4, (nan,) * 3, (inf,) * 3, (1e300,) * 3, "123", ({},) * 3):
        yield from (grab(VIA), drag(VIA, place))
    for wxyz in ([1.0] * 3, [nan] * 4, None, "1234"):
        yield drag(VIA, wxyz=wxyz)
    for name in (None, 3, [], {}, "/nowhere", "/hand_path", "/arm", "x" * 5000, "/direct/hand"):
        yield from (grab(name), drag(name), leave(name))
    yield from (grab(VIA, owner=owner) for owner in ([], {}, 3, "somebody"))
    yield grab(VIA, more=1)
    yield {"type": [], "name": VIA}


def test_what_no_control_sends_is_dropped(visit, capfd):
    visit, graph = visit()
    before = graph.controls()

    async def story(operator):
        await visit.say(operator, *malformed(graph.page))
        assert graph.controls() == before
        await visit.like(operator)
        await visit.say(operator, grab(VIA), drag(VIA), leave(VIA))
        await visit.until(lambda: "via_points" in dict(graph.heard))

    visit.run(story)
    error = capfd.readouterr().err
    assert "Traceback" not in error, error


@pytest.mark.parametrize("button", ["_keep", "_undo", "_thumbs"])
def test_a_flood_of_clicks_is_one_action(visit, button):
    visit, graph = visit()
    control = getattr(graph.page._skills, button)
    value, clicked = "Good" if button == "_thumbs" else True, []
    control.on_click(lambda _: clicked.append(1))

    async def story(operator):
        await send(operator, *[update(control, value)] * CLICKS)
        visit.sent += CLICKS
        await eventually(lambda: len(clicked) == CLICKS)  # the graph's thread does other things
        await visit.until(lambda: graph.heard)
        await visit.say(operator, update(graph.page._skills._thumbs, "Bad"))
        await visit.until(lambda: "down" in [m.values[0].value for _, m in graph.heard if m])
        assert len(graph.heard) <= FEW

    visit.run(story)


def test_an_onlookers_flood_does_not_displace_the_operators_action(visit):
    visit, graph = visit()
    thumbs = graph.page._skills._thumbs

    async def story(operator, onlooker):
        await visit.say(operator, update(graph.page._via._phase, 0.25))
        await visit.until(lambda: not graph.page._asked)
        await send(operator, update(thumbs, "Good"))
        await eventually(lambda: graph.page._asked)  # and the graph's thread does other things
        await send(onlooker, *[update(thumbs, "Bad")] * CLICKS)
        visit.sent += 1 + CLICKS
        await eventually(lambda: visit.judged >= visit.sent)
        await visit.until(lambda: graph.heard)

    visit.run(story, browsers=2)


def test_who_was_followed_in_the_middle_of_a_drag_drops_nothing(visit, monkeypatch):
    visit, graph = visit()
    via = graph.page._via

    async def story(first, second):
        await visit.say(first, grab(VIA), drag(VIA))
        await visit.until(lambda: via._dragged.held)
        with monkeypatch.context() as patch:
            patch.setattr(admission, "IDLE_S", 0.0)
            assert not via._dragged.held
            await visit.say(second, update(via._phase, 0.25))
        await visit.until(lambda: via._phase.value == 0.25)
        await visit.say(first, drag(VIA, (0.9, 0.9, 0.9)), leave(VIA))
        await first.close()
        await visit.until(lambda: len(graph.page._server.get_clients()) == 1)
        await visit.like(second)
        await visit.say(second, grab(VIA), drag(VIA), leave(VIA))
        await visit.until(lambda: "via_points" in dict(graph.heard))
        assert "[0.3, 0.2, 0.1]" in dict(graph.heard)["via_points"]

    visit.run(story, browsers=2)


def test_a_wrist_that_is_taken_again_is_taken_once_and_held_while_it_is_in_use(visit):
    visit, graph = visit(begin=False)
    teach = graph.page._teach

    async def story(operator):
        await visit.say(operator, update(teach._take, True))
        await visit.until(lambda: not teach._reach.disabled)
        teach._take_or_release()  # given up and taken again between two updates
        assert len(list(graph.node.timers)) == graph.timers + 1
        assert graph.node.count_publishers("mocap/wrist/pose") == 1
        await visit.say(operator, update(teach._reach, True))
        await visit.until(lambda: teach._session.busy)
        teach._take.value = False  # before the page has disabled it
        teach._take_or_release()
        assert teach._take.value and graph.node.count_publishers("mocap/wrist/pose") == 1

    visit.run(story)


def test_the_plan_is_changed_undone_and_saved_by_who_operates(visit):
    visit, graph = visit()
    plan, told = graph.page._watch._plan, []

    async def story(operator):
        for control, value, what in (
            (plan._change, "Forget", "plan"),
            (plan._undo, True, "plan"),
            (plan._save, True, SAVE),
        ):
            await visit.until(lambda c=control: not c.disabled)
            await visit.say(operator, update(control, value))
            await visit.until(lambda w=what: w in dict(graph.heard), what)
            told.append(dict(graph.heard)[what])
            graph.heard.clear()

    visit.run(story)
    assert [text and read_plan(text).names for text in told] == [("base",), ("base", "lid"), None]


def test_the_arm_is_asked_for_nothing_that_it_cannot_do(visit):
    visit, graph = visit(begin=False)
    teach = graph.page._teach
    hand = teach._handles._handles["direct", "hand"]

    def asked():
        return [message for topic, message in graph.heard if topic == "joint_trajectory"]

    def wrist():
        poses = [message.pose for topic, message in graph.heard if topic == "mocap/wrist/pose"]
        return position_array(poses[-1])

    async def story(operator):
        await visit.say(operator, update(teach._take, True), update(teach._how, BY_HAND))
        await visit.until(lambda: hand.visible)
        for place in ((1e8, 1e8, 1e8), (0.0, 0.0, -1e8), (0.5, 0.3, 0.5)):
            await visit.say(operator, grab(HAND), drag(HAND, place), leave(HAND))
        await visit.until(asked, "a command")
        teach._teleoperation.send_arm(LWR_LIMITS.upper, 0.5)
        await visit.until(lambda: asked()[-1].points[-1].positions[0] > 2.9)
        await visit.say(operator, grab(WRIST), drag(WRIST, (0.7, 0.1, 0.4)), leave(WRIST))
        await visit.until(lambda: np.allclose(wrist(), (0.7, 0.1, 0.4), atol=1e-3), "the wrist")
        for message in asked():
            times, positions, rest = trajectory_arrays(message)
            TrajectoryCommand.validated(message.joint_names, times, positions, rest["velocities"])

    visit.run(story)
