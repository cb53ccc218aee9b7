# SPDX-License-Identifier: Apache-2.0
"""The demo's log holds the session alone, whatever is taught meanwhile or afterwards."""

import numpy as np
from sensor_msgs.msg import JointState

from intent_recognition.nodes import qos
from intent_recognition.nodes.session_observer import SessionObserver


def told(labels, values):
    return JointState(name=labels, position=values)


def test_a_task_taught_meanwhile_is_left_out(harness):
    observer = harness.add(SessionObserver(print, print))
    publisher = harness.publisher(JointState, "intent/tasks", qos.STATE)
    harness.connect(publisher)
    publisher.publish(told(["plate", "none"], [0.25, 0.75]))
    publisher.publish(told(["plate", "wave", "none"], [0.25, 0.5, 0.25]))
    publisher.publish(told(["none"], [1.0]))
    harness.spin_until(lambda: len(observer._tasks) == 3)
    log = observer.log()
    assert log.labels == ("plate", "none")
    np.testing.assert_array_equal(log.probabilities, [[0.25, 0.75], [0.25, 0.25], [0.0, 1.0]])


def test_closed_it_hears_no_more(harness):
    observer = harness.add(SessionObserver(print, print, namespace="closing"))
    publisher = harness.publisher(JointState, "closing/intent/tasks", qos.STATE)
    harness.connect(publisher)
    observer.close()
    harness.spin_until(lambda: publisher.get_subscription_count() == 0)
    assert observer.log().probabilities.size == 0
