# SPDX-License-Identifier: Apache-2.0
"""Lifecycle nodes: transitions, and what fails on the way."""

import pytest
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.parameter import Parameter

from intent_recognition.errors import ModelError
from intent_recognition.nodes.lifecycle import ManagedNode


class Managed(ManagedNode):
    """Notes its transitions, and fails where it is told to."""

    def __init__(self, fail: Exception | None = None, **kwargs):
        super().__init__("managed", **kwargs)
        self.fail, self.seen = fail, []
        self.start()

    def configure(self):
        if self.fail:
            raise self.fail
        self.seen.append("configure")

    def activate(self):
        self.seen.append("activate")
        if self.fail:
            raise self.fail

    def deactivate(self):
        self.seen.append("deactivate")


def change(harness, transition):
    request = ChangeState.Request(transition=Transition(id=transition))
    return harness.call(ChangeState, "managed/change_state", request).success


@pytest.mark.parametrize("transition", [Transition.TRANSITION_ACTIVATE, 77])
def test_managed_node_refuses_a_transition_that_does_not_begin_here(harness, transition):
    node = harness.add(Managed())
    assert not change(harness, transition)
    assert node.active
    assert change(harness, Transition.TRANSITION_DEACTIVATE)


def test_managed_node_raises_what_failed_at_start(harness):
    with pytest.raises(ModelError, match="from the future"):
        Managed(fail=ModelError("a model from the future"))


def test_a_managed_node_that_is_destroyed_leaves_the_graph(harness):
    node = Managed()
    harness.spin_until(lambda: "managed" in harness.probe.get_node_names())
    node.destroy_node()
    harness.spin_until(lambda: "managed" not in harness.probe.get_node_names())


@pytest.mark.parametrize("error", [ModelError("no model"), ZeroDivisionError()])
def test_managed_node_survives_a_failing_transition(harness, error):
    override = [Parameter("autostart", value=False)]
    node = harness.add(Managed(fail=error, parameter_overrides=override))
    assert not change(harness, Transition.TRANSITION_CONFIGURE)
    node.fail = None
    assert change(harness, Transition.TRANSITION_CONFIGURE)
    assert change(harness, Transition.TRANSITION_ACTIVATE)
    assert node.active


@pytest.mark.parametrize(
    ("error", "again"),
    [
        (ModelError("no model"), (Transition.TRANSITION_ACTIVATE,)),
        (ZeroDivisionError(), (Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE)),
    ],
)
def test_an_activation_that_fails_is_undone(harness, error, again):
    node = harness.add(Managed())
    assert change(harness, Transition.TRANSITION_DEACTIVATE)
    node.fail = error
    assert not change(harness, Transition.TRANSITION_ACTIVATE)
    assert not node.active and node.seen[-2:] == ["activate", "deactivate"]
    node.fail = None
    assert all(change(harness, transition) for transition in again)
    assert node.active
