# SPDX-License-Identifier: Apache-2.0
"""The handle on the predicted path becomes a via point, and the button takes it back."""

import asyncio
from types import SimpleNamespace

import numpy as np
import pytest

from intent_recognition.composing import ViaPoint, read_via_points
from intent_recognition.dashboard.via_controls import ViaPointControls
from intent_recognition.dashboard.widgets import PageAccess

PATH = ("plate", np.outer(np.linspace(0.0, 1.0, 5), [0.4, 0.2, 0.1]))


class Estimator:
    """Takes the parameter, as the node does, and tells what is in force."""

    def __init__(self):
        self.points: tuple[ViaPoint, ...] = ()

    def set_parameter(self, node, name, value):
        assert (node, name) == ("intent_estimator", "via_points")
        self.points = read_via_points(value)


@pytest.fixture
def controls(server, monkeypatch):
    estimator = Estimator()
    monkeypatch.setattr(server, "get_clients", lambda: {0: None})
    made = ViaPointControls(PageAccess(server, estimator, lambda action: action()))
    return SimpleNamespace(made=made, estimator=estimator, handle=made._handle)


def drag(controls, place, phase):
    event = SimpleNamespace(phase=phase, target=SimpleNamespace(position=place), client_id=0)
    asyncio.run(controls.made._dragged._update(event))


def test_what_is_dropped_passes_there_until_it_is_removed(controls):
    made, estimator = controls.made, controls.estimator
    made.update((), PATH)
    assert not controls.handle.visible, "it is shown on demand"
    made._drag.value = True
    made.update((), PATH)
    np.testing.assert_allclose(controls.handle.position, [0.2, 0.1, 0.05])
    drag(controls, (0.25, 0.1, 0.05), "start")
    made.update((), (PATH[0], PATH[1] + 1.0))
    np.testing.assert_allclose(controls.handle.position, [0.2, 0.1, 0.05], err_msg="it is held")
    assert estimator.points == ()
    drag(controls, (0.25, 0.1, 0.05), "end")
    expected = ViaPoint("page 1", {"hand": (0.25, 0.1, 0.05)}, (0.01,) * 3, 0.5, None, "plate")
    assert estimator.points == (expected,)
    made.update(estimator.points, PATH)
    np.testing.assert_allclose(controls.handle.position, [0.2, 0.1, 0.05])
    drag(controls, (0.3, 0.0, 0.0), "end")
    made.update(estimator.points, PATH)
    assert made._chosen.options == ("page 1", "page 2") and made._chosen.value == "page 2"
    made._chosen.value = "page 1"
    made.remove()
    made.update(estimator.points, PATH)
    assert [point.name for point in estimator.points] == ["page 2"]
    made.remove()
    made.update(estimator.points, PATH)
    assert made._remove.disabled and estimator.points == ()


def test_before_a_prediction_there_is_nothing_to_drag(controls):
    controls.made._drag.value = True
    controls.made.update((), None)
    drag(controls, (0.3, 0.0, 0.0), "end")
    assert not controls.handle.visible and controls.estimator.points == ()
