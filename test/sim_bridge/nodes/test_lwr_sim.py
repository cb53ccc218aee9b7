# SPDX-License-Identifier: Apache-2.0
"""The node lwr_sim on its topics: rates, motion, pushes, guiding, bad input."""

from types import SimpleNamespace

import numpy as np
import pytest
from geometry_msgs.msg import WrenchStamped
from joint_trajectories import build_joint_trajectory
from rclpy.time import Time
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool
from trajectory_msgs.msg import JointTrajectory

from intent_recognition.errors import ResourceBusyError
from intent_recognition.kinematics.lwr import JOINT_NAMES
from intent_recognition.nodes.conversions import stamp_ns
from intent_recognition.nodes.qos import COMMAND, SENSOR, STATE
from sim_bridge.nodes.lwr_sim import LwrSim
from sim_bridge.scenarios.toolbox.scene import HOME

LATER_S = 1e6
SHIFT = np.array([0.3, 0.1, -0.2, 0.15, 0.2, -0.1, 0.3])


def trajectory(goal, time_s=0.8, names=JOINT_NAMES, stamp_ns=0):
    rest = np.zeros((1, len(goal)))
    return build_joint_trajectory(names, np.array([time_s]), goal + rest, rest, time_ns=stamp_ns)


def newest(states, field="position"):
    return np.array(getattr(states[-1], field))


def near(states, goal, tolerance=2e-3):
    still = states and np.abs(newest(states, "velocity")).max() < 0.02
    return still and np.abs(newest(states) - goal).max() < tolerance


@pytest.mark.slow
@pytest.mark.parametrize(("rate_hz", "gaps_ms"), [(200.0, {5}), (300.0, {3, 4})])
def test_joint_states_have_their_rate_in_simulated_time_by_their_stamps(harness, rate_hz, gaps_ms):
    states = harness.collect(JointState, "joint_states", STATE)
    clocks = harness.collect(Clock, "/clock", STATE)
    node = harness.node(LwrSim, publish_clock=True, real_time_factor=2.0, joint_state_rate=rate_hz)
    harness.spin_until(lambda: len(states) > 200 and len(clocks) > 200)
    stamps = np.array([stamp_ns(message) for message in states])
    ticks = np.array([Time.from_msg(message.clock).nanoseconds for message in clocks])
    for times_ns in (stamps, ticks):
        assert set(np.diff(times_ns)) == {gap * 1_000_000 for gap in gaps_ms}
    assert (len(stamps) - 1) / np.ptp(stamps * 1e-9) == pytest.approx(rate_hz, rel=0.01)
    assert list(states[0].name) == list(JOINT_NAMES)
    assert np.allclose(newest(states), HOME, atol=1e-6)
    assert len(states[-1].velocity) == len(states[-1].effort) == 7
    assert np.abs(newest(states, "effort")).max() > 1.0
    assert node.arm.time_s >= 200 / rate_hz


@pytest.mark.slow
@pytest.mark.parametrize("factor", [1.0, 2.0])
def test_without_clock_stamps_are_ros_time(harness, factor):
    states = harness.collect(JointState, "joint_states", STATE)
    node = harness.node(LwrSim, real_time_factor=factor)
    before = node.get_clock().now().nanoseconds
    harness.spin_until(lambda: len(states) > 150)
    stamps = np.array([stamp_ns(message) for message in states])
    assert np.all(np.diff(stamps) > 0)
    assert np.median(np.diff(stamps)) == pytest.approx(5e6 / factor, rel=0.02)
    now = node.get_clock().now().nanoseconds
    assert before - 200_000_000 < stamps[0] <= stamps[-1] <= now


def test_a_physics_that_falls_behind_is_where_its_stamps_say(harness, monkeypatch):
    """Also after it has left out some time, as on a busy machine; the difference fades."""
    node, now_s, seen = harness.node(LwrSim), [100.0], []
    clock = SimpleNamespace(now=lambda: SimpleNamespace(nanoseconds=round(now_s[0] * 1e9)))
    monkeypatch.setattr(node, "get_clock", lambda: clock)
    monkeypatch.setattr(node.clock, "now_s", lambda: now_s[0])
    monkeypatch.setattr(node, "_publish", lambda ns: seen.append((ns, node.arm.reference.position)))

    def wait(length_s):
        until_s = now_s[0] + length_s
        while now_s[0] < until_s:
            now_s[0] += 0.005
            node._tick()

    node._tick()
    wait(0.1)
    now_s[0] += 0.08  # so much is yet to be computed
    start_s, lasts_s = now_s[0] + 0.05, 3.0
    message = trajectory(HOME + SHIFT, lasts_s, stamp_ns=round(start_s * 1e9))
    message.points.insert(0, trajectory(HOME, 0.0).points[0])
    node._on_trajectory(message)
    wait(0.8)
    now_s[0] += 0.4  # more than it catches up
    wait(2.0)
    assert node.clock.pacer.dropped_s > 0.25
    assert np.all(np.diff([at_ns for at_ns, _ in seen]) > 0)
    times_s = np.array([at_ns * 1e-9 - start_s for at_ns, _ in seen])
    u = np.clip(times_s / lasts_s, 0.0, 1.0)[:, None]
    off = np.abs([q for _, q in seen] - (HOME + SHIFT * u**2 * (3.0 - 2.0 * u))).max(axis=1)
    assert off[times_s < 0.6].max() < 2e-4
    assert off[times_s > 2.0].max() < 2e-4  # a step of physics is 1 ms


def bad_messages(now_ns):
    """One message per part of it that is read; all reasons are in test_follower_rejects."""
    good = HOME + SHIFT
    running, hasty = trajectory(good), trajectory(good)
    running.points[0].velocities = [0.2] * 7
    hasty.points[0].accelerations = [1e3] * 7
    return {
        "wrong_joint_names": trajectory(good, names=[f"joint_{i}" for i in range(7)]),
        "outside_position_limits": trajectory(HOME + 3.0, 9.0),
        "velocity_at_end": running,
        "outside_acceleration_limits": hasty,
        "ends_in_past": trajectory(good, 0.001, stamp_ns=1),
        "starts_too_late": trajectory(good, stamp_ns=now_ns),
    }


@pytest.mark.slow
def test_bad_trajectories_are_counted_and_the_arm_keeps_moving(harness):
    states = harness.collect(JointState, "joint_states", STATE)
    sender = harness.publisher(JointTrajectory, "joint_trajectory", COMMAND)
    node = harness.node(LwrSim, publish_clock=True, real_time_factor=2.0)
    harness.connect(sender)
    harness.spin_until(lambda: len(states) > 10)
    sender.publish(trajectory(HOME + SHIFT, 2.0))
    harness.spin_until(lambda: node.diagnostics._totals["joint_trajectory"] == 1)
    asked = node.commands.follower.sample(LATER_S)
    for reason, message in bad_messages(node.get_clock().now().nanoseconds).items():
        sender.publish(message)
        harness.spin_until(lambda reason=reason: node.diagnostics.rejected(reason), what=reason)
        np.testing.assert_array_equal(node.commands.follower.sample(LATER_S), asked)
    harness.spin_until(lambda: near(states, HOME + SHIFT))
    assert node.diagnostics._counts == dict.fromkeys(bad_messages(1), 1)


def push(force, frame="world"):
    message = WrenchStamped()
    message.header.frame_id = frame
    message.wrench.force.x, message.wrench.force.y, message.wrench.force.z = force
    return message


@pytest.mark.slow
def test_a_push_moves_the_arm_and_it_comes_back(harness):
    states = harness.collect(JointState, "joint_states", STATE)
    pusher = harness.publisher(WrenchStamped, "lwr_sim/push", SENSOR)
    node = harness.node(LwrSim, publish_clock=True, real_time_factor=2.0)
    harness.connect(pusher)

    def pushed():
        pusher.publish(push((0.0, 20.0, 0.0)))
        return states and np.abs(newest(states) - HOME).max() > 0.05

    harness.spin_until(pushed)
    harness.spin_until(lambda: near(states, HOME, 2e-3))
    for force, frame, reason in (
        ((np.nan, 0.0, 0.0), "world", "not_finite"),
        ((1e4, 0.0, 0.0), "", "push_too_strong"),
        ((1.0, 0.0, 0.0), "elsewhere", "unknown_frame"),
    ):
        pusher.publish(push(force, frame))
        harness.spin_until(lambda reason=reason: node.diagnostics.rejected(reason))


@pytest.mark.slow
def test_in_gravity_compensation_no_trajectory_is_taken(harness):
    states = harness.collect(JointState, "joint_states", STATE)
    sender = harness.publisher(JointTrajectory, "joint_trajectory", COMMAND)
    node = harness.node(LwrSim, publish_clock=True, real_time_factor=2.0)
    harness.connect(sender)
    harness.spin_until(lambda: states)
    for guided in (True, False):
        request = SetBool.Request(data=guided)
        assert harness.call(SetBool, "lwr_sim/gravity_compensation", request).success
        sender.publish(trajectory(HOME + SHIFT))
        if guided:
            harness.spin_until(lambda: node.diagnostics.rejected("gravity_compensation"))
            assert np.abs(newest(states) - HOME).max() < 0.01
    harness.spin_until(lambda: near(states, HOME + SHIFT))


def test_follows_the_clock_of_another_node(harness):
    states = harness.collect(JointState, "joint_states", STATE)
    clock = harness.publisher(Clock, "/clock", 10)
    node = harness.node(LwrSim, use_sim_time=True)
    harness.connect(clock)
    time_ns = 10**9

    def advance():
        nonlocal time_ns
        time_ns += 10_000_000
        clock.publish(Clock(clock=Time(nanoseconds=time_ns).to_msg()))
        return node.arm.n_steps

    harness.spin_until(advance)
    offset_ns = time_ns - node.arm.n_steps * 1_000_000
    for _ in range(200):
        advance()
        steps = (time_ns - offset_ns) // 1_000_000
        harness.spin_until(lambda steps=steps: node.arm.n_steps >= steps - 20)
    assert node.arm.n_steps * 1_000_000 <= time_ns - 10**9
    harness.spin_until(lambda: len(states) > 300)
    assert np.all(np.diff([stamp_ns(message) for message in states]) > 0)


def test_a_clock_that_does_not_come_and_no_display_are_said(harness, monkeypatch):
    node = harness.node(LwrSim, use_sim_time=True)
    node._report()
    later_s = node.diagnostics._clock() + 4.0
    monkeypatch.setattr(node.diagnostics, "_clock", lambda: later_s)
    assert node.diagnostics.report().message.count("/clock") == 1
    monkeypatch.delenv("DISPLAY", raising=False)
    with pytest.raises(ResourceBusyError, match="display"):
        harness.node(LwrSim, headless=False)


def test_may_follow_its_own_clock(harness):
    """With `use_sim_time` for the whole graph the clock's publisher still runs by itself."""
    states = harness.collect(JointState, "joint_states", STATE)
    node = harness.node(LwrSim, publish_clock=True, use_sim_time=True)
    harness.spin_until(lambda: len(states) > 50)
    harness.spin_until(lambda: node.get_clock().now().nanoseconds >= stamp_ns(states[50]))
