# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.time import Time
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from intent_recognition.errors import ArgumentError
from intent_recognition.nodes.conversions import stamp_ns
from intent_recognition.nodes.diagnostics import ENDED, values_of
from intent_recognition.nodes.qos import FEEDBACK, SENSOR, STATE
from intent_recognition.registry import ANSWERS
from sim_bridge.coworker.session import SessionTiming, plan_people, plan_session
from sim_bridge.nodes.coworker_sim import SAMPLE_NS, CoworkerSim
from sim_bridge.scenarios.assembly import session as assembly

LISTENER = QoSProfile(depth=2000, reliability=ReliabilityPolicy.BEST_EFFORT)
TIMING = SessionTiming(0.5, (0.5, 0.6), (0.1, 0.2), 0.2, 0.5)
TASKS = ("plate_handover", "hold_screwdriver>plate_handover@0.25")
SESSION = {
    "seed": 5,
    "task_list": ",".join(TASKS),
    "first_idle": 0.5,
    "idle": [0.5, 0.6],
    "hold": [0.1, 0.2],
    "last_idle": 0.2,
    "occlusions": 0.5,
    "exit_at_end": True,
    "wait_for_nodes": [""],
}


def make(harness, **overrides) -> CoworkerSim:
    return harness.node(CoworkerSim, **SESSION | overrides)


def at(time_ns):
    return Clock(clock=Time(nanoseconds=time_ns).to_msg())


def play(harness, node, clock, step_ns=5_000_000):
    """Advance /clock by one step whenever the executor has dispatched, until the session ends."""
    now = [1_000_000_000]

    def advance():
        clock.publish(at(now[0]))
        now[0] += step_ns
        return node.done

    harness.connect(clock)
    harness.spin_until(advance, deadline_s=60.0, what="end of the session")


@pytest.fixture
def played(harness):
    poses = harness.collect(PoseStamped, "mocap/wrist/pose", LISTENER)
    labels = harness.collect(String, "coworker/task", STATE)
    node = make(harness, use_sim_time=True)
    play(harness, node, harness.publisher(Clock, "/clock", 10))
    expected = plan_session(5, TASKS, TIMING)
    harness.spin_until(lambda: len(labels) == 6, what="six labels")
    harness.spin_until(lambda: len(poses) >= expected.samples.visible.sum(), what="all samples")
    return node, poses, labels, expected


def test_publishes_what_the_plan_says_bit_for_bit(played):
    node, poses, labels, expected = played
    seen = np.flatnonzero(expected.samples.visible)
    changed = ["hold_screwdriver", "plate_handover", ""]
    assert [m.data for m in labels] == ["plate_handover", "", *changed, ""]
    assert [stamp_ns(m) for m in poses] == [node.first_stamp_ns + k * SAMPLE_NS for k in seen]
    sent = np.array([[m.pose.position.x, m.pose.position.y, m.pose.position.z] for m in poses])
    np.testing.assert_array_equal(sent, expected.samples.positions_m[seen])
    assert {m.header.frame_id for m in poses} == {"world"}
    assert node.diagnostics.rejected("occluded") == np.sum(~expected.samples.visible)


def test_each_of_several_people_has_a_session_and_topics_of_their_own(harness):
    people = ("anna", "ben")
    labels = {p: harness.collect(String, f"coworker/{p}/task", STATE) for p in people}
    poses = {p: harness.collect(PoseStamped, f"mocap/{p}/wrist/pose", LISTENER) for p in people}
    lists = "plate_handover;screw_handover,screw_handover"
    node = make(harness, use_sim_time=True, persons=list(people), task_list=lists)
    play(harness, node, harness.publisher(Clock, "/clock", 10))
    tasks = [("plate_handover",), ("screw_handover", "screw_handover")]
    expected = dict(zip(people, plan_people(5, tasks, TIMING), strict=True))
    for person, plan in expected.items():
        seen = plan.samples.positions_m[plan.samples.visible]
        n = len(seen)
        harness.spin_until(lambda p=person, n=n: len(poses[p]) >= n, what="all samples")
        sent = [m.pose.position for m in poses[person]]
        np.testing.assert_array_equal([[p.x, p.y, p.z] for p in sent], seen)
        assert [m.data for m in labels[person] if m.data] == [i.task for i in plan.interactions]
    rests = [plan.samples.positions_m[0, 1] for plan in expected.values()]
    assert rests[0] - rests[1] > 0.1  # side by side


def test_the_end_is_reported_before_the_node_leaves(harness):
    reports = harness.collect(DiagnosticArray, "/diagnostics", 10)
    node = make(harness, use_sim_time=True, wait_for_subscribers=0)
    play(harness, node, harness.publisher(Clock, "/clock", 10))
    last = harness.spin_until(
        lambda: [s for r in reports for s in r.status if ENDED in values_of(s)], what="the end"
    )
    assert last[0].message == "session over"


def test_a_worker_assembles_a_box(harness):
    """The worker of a session that is none of the recorded ones; who helps is somebody else."""
    node = make(harness, scenario="assembly", task_list="fastening,hand_over")
    assert [shown.task for shown in node.workers[0].plan.interactions] == ["fastening", "hand_over"]
    session = assembly.plan_session(5, 3, ("fastening", "hand_over"), idle_s=(0.5, 0.6), hold_s=0.2)
    expected = session.worker.positions_m
    np.testing.assert_array_equal(node.workers[0].plan.samples.positions_m, expected)


def test_waits_for_subscribers_and_for_the_clock(harness):
    node = make(harness, use_sim_time=True)
    clock = harness.publisher(Clock, "/clock", 10)
    harness.connect(clock)
    ticks = []
    harness.probe.create_timer(0.05, lambda: ticks.append(0))
    harness.spin_until(lambda: len(ticks) >= 4)
    assert node.first_stamp_ns == 0
    harness.collect(PoseStamped, "mocap/wrist/pose", SENSOR)

    def begin():
        clock.publish(at(7_000_000_000))
        return node.first_stamp_ns

    assert harness.spin_until(begin, what="begin of the session") == 7_000_000_000


def test_where_time_waits_for_answers_the_session_begins_with_a_time_of_the_clock(harness):
    """Not between two of them, when the others may have gone on."""
    harness.collect(JointState, ANSWERS, FEEDBACK)
    harness.collect(PoseStamped, "mocap/wrist/pose", SENSOR)
    reports = harness.collect(DiagnosticArray, "/diagnostics", 10)
    node = make(harness, use_sim_time=True)
    clock = harness.publisher(Clock, "/clock", 10)
    harness.connect(clock)
    clock.publish(at(7_000_000_000))
    harness.spin_until(
        lambda: [s for r in reports for s in r.status if s.message == "running"],
        what="a worker who is ready",
    )
    assert node.first_stamp_ns == 0
    clock.publish(at(7_005_000_000))
    harness.spin_until(lambda: node.first_stamp_ns, what="begin of the session")
    assert node.first_stamp_ns == 7_005_000_000


def test_a_clock_that_waits_hears_of_the_worker_once_the_others_are_ready(harness):
    """Time begins with this answer, so the worker needs no time before it."""
    heard = harness.collect(JointState, ANSWERS, FEEDBACK)
    node = make(harness, use_sim_time=True)
    harness.spin_until(lambda: node.diagnostics.answers, what="somebody who waits")
    node.diagnostics.answer()
    assert not node.diagnostics.ready  # nobody listens to the poses
    harness.collect(PoseStamped, "mocap/wrist/pose", SENSOR)
    harness.spin_until(lambda: node.diagnostics.ready, what="a worker who is ready")
    assert not heard
    node.diagnostics.answer()
    harness.spin_until(lambda: heard, what="an answer")
    assert (heard[0].header.frame_id, node.first_stamp_ns) == ("coworker_sim", 0)


@pytest.mark.parametrize(
    "bad",
    [
        *({"task_list": "dance"}, {"task_list": ","}, {"hold": [2.0, 1.0]}, {"seed": -1}),
        *({"scenario": "x"}, {"persons": ["anna", "ben"], "task_list": ";".join(TASKS[:1] * 3)}),
    ],
)
def test_bad_parameters_are_named_errors(harness, bad):
    with pytest.raises(ArgumentError):
        make(harness, **bad)
