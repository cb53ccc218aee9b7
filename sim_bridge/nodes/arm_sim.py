# SPDX-License-Identifier: Apache-2.0
"""The node `arm_sim`: a torque-controlled arm in PyBullet, 1 kHz physics."""

import os
import time
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time as TimeMessage
from geometry_msgs.msg import WrenchStamped
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.time import Time
from rosgraph_msgs.msg import Clock as ClockMessage
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import SetBool
from trajectory_msgs.msg import JointTrajectory

from intent_recognition.errors import ArgumentError, ResourceBusyError, TrajectoryError
from intent_recognition.kinematics import JOINT_NAMES, parse_boxes
from intent_recognition.nodes.conversions import duration_s, stamp_ns
from intent_recognition.nodes.diagnostics import Diagnostics, Level
from intent_recognition.nodes.parameters import declare
from intent_recognition.nodes.qos import COMMAND, FEEDBACK, LATCHED, SENSOR, STATE
from intent_recognition.nodes.runtime import run, steady_timer
from intent_recognition.registry import ANSWERS
from sim_bridge.arm import (
    TIME_STEP_S,
    Pacer,
    RejectedTrajectoryError,
    Robot,
    SensorNoise,
    SimulatedArm,
    SpreadControl,
    Surroundings,
    TrajectoryCommand,
    TrajectoryFollower,
    find_robot,
)
from sim_bridge.handover import GRIP_M, with_fingers
from sim_bridge.nodes.clock_answers import ClockAnswers
from sim_bridge.nodes.pouring_scene import POURING, PouringScene, make_scene
from sim_bridge.nodes.transfer_scene import TAKES, TRANSFERS, TransferScene
from sim_bridge.scenarios.toolbox import HOME, ToolboxGripper

TICK_S = 0.002
"""Period of the timer that runs due physics steps [s]. Convention: half a joint state."""
STEP_NS = 1_000_000
"""Physics step [ns]."""
PUSH_STEPS = 100
"""Physics steps that a push lasts: 0.1 s. Convention."""
GRIPPER_STEPS = 5
"""Physics steps between two decisions of the gripper. Convention."""
BURST = 8
"""Joint states sent at once when catching up: fewer than their queue holds (`qos.STATE`)."""
DROPPED_S = 0.02
"""Time that the physics has left out [s], after which the command in force is taken up where it is
by its stamp. Convention: 0.04 rad of a fast motion."""
LARGEST_PUSH_N = 500.0
"""Stronger pushes are rejected [N]. Convention."""
WORLD_FRAME = "world"
CONTROLLERS = ("low_gain", "stochastic_feedback")


class ArmSim(Node):
    """Physics paced by a steady clock; its state goes out, trajectories and pushes come in.

    In: `joint_trajectory`; `~/push` (a force at the hand in world axes, held for 0.1 s after
    each message; torques are ignored); `~/gravity_compensation`; `intent/active_task`, for the
    objects of the `scene`, which the hand takes and gives; `intent/robot_trajectory`, whose
    standard deviations set the stiffness if `controller` is "stochastic_feedback". Out:
    `joint_states`, `robot_description`, `/clock` if `publish_clock`, `/diagnostics`.

    Stamps are simulated time (from zero at start) if `publish_clock`, else ROS time. With
    `use_sim_time` and another node's `/clock` the physics follows that clock.

    Joints beside the chain of the arm, such as fingers, are in `joint_states` after those of the
    chain; the gripper moves them.

    Args:
        name: of the node.
        robot: which arm; None: the parameters say.
        kwargs: as a node takes them.
    """

    def __init__(self, name: str = "arm_sim", robot: Robot | None = None, **kwargs: Any) -> None:
        super().__init__(name, **kwargs)
        self._declare()
        self._robot = robot if robot is not None else self._find_robot()
        if self._scene == TRANSFERS:
            self._robot = with_fingers(self._robot)
        self.arm = self._make_arm()
        self.surroundings = Surroundings(self.arm, self._boxes)
        self.spread = self._make_spread()
        self.follower = TrajectoryFollower(self.arm.reference.q, self.arm.limits)
        self.arm.before_step.append(self._control)
        self.diagnostics = Diagnostics(self)
        takes = {"joint_trajectory"}
        if self._scene != "none":
            takes.add("intent/active_task")
        if self._scene == TRANSFERS:
            takes.update(TAKES)
        self._answers = ClockAnswers(self, self._answering, self.diagnostics, takes)
        self.gripper = self._make_scene(GRIP_M if robot is not None else 0.0)
        self._push_n, self._push_until = np.zeros(3), 0
        self._tracking_error_rad = 0.0
        self._others = self.arm.other_joints
        self._message = JointState(name=[*self._robot.joint_names, *self._others])
        self._make_topics()
        follows = self.get_parameter("use_sim_time").value
        self._external_clock = follows and not self._publishes_clock
        self._pacer: Pacer | None = None
        self._followed: tuple[TrajectoryCommand, int] | None = None
        self._caught_up_s = 0.0
        self._person = False
        if self._answering:
            self.create_subscription(JointState, ANSWERS, self._on_answer, FEEDBACK)
        self.add_post_set_parameters_callback(self._on_parameters)
        timers = ((TICK_S, self._tick), (0.5, self._report))
        self._pacing_timers = [steady_timer(self, *timer) for timer in timers]

    def destroy_node(self) -> None:
        """Close the world with the node."""
        super().destroy_node()
        self.arm.close()

    def _declare(self) -> None:
        """Declare all parameters; only the pace can change while the physics runs."""
        values = declare(self, "arm")
        declare(self, "people")  # read by the scene of transfers
        self._rate_hz = values["joint_state_rate"]
        self._factor = values["real_time_factor"]
        self._publishes_clock = values["publish_clock"]
        self._headless = values["headless"]
        self._initial = values["initial_position"]
        self._stiffness_scale = values["stiffness_scale"]
        self._noisy = values["sensor_noise"]
        self._scene = values["scene"]
        self._pouring = PouringScene(self)
        self._boxes = parse_boxes(values["boxes"])
        self._answering: list[str] = values["wait_for_answers"]
        if self._answering and not self._publishes_clock:
            cure = "Set publish_clock, or leave it empty."
            raise ArgumentError.about("wait_for_answers", "publish_clock", self._answering, cure)
        self._seed = values["seed"]
        self._controller = values["controller"]

    def _find_robot(self) -> Robot:
        """The arm that the parameters name."""
        values = declare(self, "robot")
        base = values["base_position"] or None
        return find_robot(values["robot"], tip=values["tip"], base_position_m=base)

    def _make_arm(self) -> SimulatedArm:
        if not self._headless and not os.environ.get("DISPLAY"):
            cure = "Set headless:=true."
            raise ResourceBusyError.about("headless", "a display for the window", "none", cure)
        initial = self._initial
        if not initial and self._scene == POURING:
            initial = self._pouring.posture
        elif not initial:
            initial = HOME if self._robot.joint_names == JOINT_NAMES else None
        return SimulatedArm(
            initial,
            robot=self._robot,
            stiffness_scale=self._stiffness_scale,
            noise=SensorNoise() if self._noisy else None,
            rng=np.random.default_rng(self._seed),
            headless=self._headless,
        )

    def _make_scene(self, lever_m: float) -> ToolboxGripper | PouringScene | TransferScene | None:
        """What handles the things of the scene; the grip is so far from the taught hand."""
        world = self.arm, self._seed
        if self._scene == TRANSFERS:
            return TransferScene(self, *world, lever_m, self._stamp, self._answers.note)
        return make_scene(self._scene, self._pouring, *world, self._stamp)

    def _stamp(self) -> TimeMessage:
        """Stamp of a message now."""
        if self._publishes_clock:
            return Time(nanoseconds=self.arm.n_steps * STEP_NS).to_msg()
        return self.get_clock().now().to_msg()

    def _make_spread(self) -> SpreadControl | None:
        if self._controller not in CONTROLLERS:
            expected, cure = f"one of {', '.join(CONTROLLERS)}", "Choose one of them."
            raise ArgumentError.about("controller", expected, self._controller, cure)
        control = SpreadControl(self._robot.joint_names)
        return control if self._controller == CONTROLLERS[1] else None

    def _make_topics(self) -> None:
        self._states = self.create_publisher(JointState, "joint_states", STATE)
        description = self.create_publisher(String, "robot_description", LATCHED)
        description.publish(String(data=self._robot.description))
        self._clock_out = None
        if self._publishes_clock:
            self._clock_out = self.create_publisher(ClockMessage, "/clock", STATE)
        commands = self.create_subscription(
            JointTrajectory, "joint_trajectory", self._on_trajectory, COMMAND
        )
        self.diagnostics.watch(commands, "joint_trajectory")
        if self.gripper is not None:
            self.create_subscription(String, "intent/active_task", self._on_task, LATCHED)
        if self.spread is not None:
            take = partial(self._on_prediction, self.spread)
            self.create_subscription(JointTrajectory, "intent/robot_trajectory", take, COMMAND)
        self.create_subscription(WrenchStamped, "~/push", self._on_push, SENSOR)
        self.create_service(SetBool, "~/gravity_compensation", self._on_gravity_compensation)

    def _on_parameters(self, parameters: list[Parameter]) -> None:
        for changed in parameters:
            if changed.name == "real_time_factor" and self._pacer is not None:
                if not self._external_clock:
                    self._pacer.change_factor(changed.value, self._now_s(), self.arm.n_steps)
                self._factor = changed.value

    def _control(self, arm: SimulatedArm) -> None:
        """Set the reference and the push of the coming step."""
        if not arm.gravity_compensation:
            reference = self.follower.sample(arm.time_s)
            arm.set_reference(*reference)
        if self.spread is not None:
            self.spread.control(arm)
        if arm.n_steps < self._push_until:
            arm.apply_force(self._push_n)
        if self.gripper is not None and arm.n_steps % GRIPPER_STEPS == 0:
            self.gripper.update()

    def _on_task(self, message: String) -> None:
        self._answers.note("intent/active_task")
        if self.gripper is not None:
            self.gripper.set_task(message.data)

    def _now_s(self) -> float:
        """The clock that paces the physics [s]."""
        if self._external_clock:
            return self.get_clock().now().nanoseconds * 1e-9
        return time.monotonic()

    def _tick(self) -> None:
        """Do the steps that are due, publishing after those that end a period."""
        now_s = self._now_s()
        if self._pacer is None:
            if now_s > 0.0:
                factor = 1.0 if self._external_clock else self._factor
                batch = max(1, int(BURST / (self._rate_hz * TIME_STEP_S)))
                self._pacer = Pacer(TIME_STEP_S, factor, now_s, largest_batch=batch)
            return
        n_due = self._pacer.due(now_s, self.arm.n_steps)
        if self._pacer.dropped_s > self._caught_up_s + DROPPED_S:
            self._catch_up(self._pacer)
        if n_due == 0:
            return
        zero_ns = 0 if self._publishes_clock else self._zero_ns(self._pacer, now_s)
        for _ in range(n_due):
            if self._answers.wait():
                return
            self.arm.step()
            n = self.arm.n_steps
            period = TIME_STEP_S * self._rate_hz
            if int(n * period + 1e-9) != int((n - 1) * period + 1e-9):
                self._publish(zero_ns + self._elapsed_ns(self._pacer))

    def _on_answer(self, message: JointState) -> None:
        counts = self._answers.hear(message)
        if not self._person and counts.get("mocap/wrist/pose"):
            self._person = True
            self.arm.begin_noise(np.random.default_rng(self._seed))
        if self._answers.all_came():
            self._tick()

    def _zero_ns(self, pacer: Pacer, now_s: float) -> int:
        """The ROS time at which the physics' time zero was, were it paced without a gap [ns]."""
        real_s = (pacer.lag(now_s, self.arm.n_steps) + self.arm.time_s) / pacer.factor
        return self.get_clock().now().nanoseconds - int(real_s * 1e9)

    def _elapsed_ns(self, pacer: Pacer) -> int:
        """Time since the physics' time zero: simulated if it is published, else ROS time [ns]."""
        factor = 1.0 if self._publishes_clock else pacer.factor
        return int(self.arm.n_steps * STEP_NS / factor)

    def _publish(self, stamp_ns: int) -> None:
        stamp = Time(nanoseconds=stamp_ns).to_msg()
        state = self.arm.state()
        message = self._message
        message.header.stamp = stamp
        n_others = len(self._others)
        message.position = state.q.tolist() + self.arm.other_positions()
        message.velocity = state.qd.tolist() + [0.0] * n_others
        message.effort = state.torque.tolist() + [0.0] * n_others
        if self._clock_out is not None:
            self._clock_out.publish(ClockMessage(clock=stamp))
        self._states.publish(message)
        self._answers.note("/clock")
        self._answers.note("joint_states")
        self.diagnostics.tick("joint_states")
        if not self.arm.gravity_compensation:
            error = float(np.abs(self.arm.reference.q - state.q).max())
            self._tracking_error_rad = max(self._tracking_error_rad, error)

    def _on_trajectory(self, message: JointTrajectory) -> None:
        self.diagnostics.tick("joint_trajectory")
        self._answers.note("joint_trajectory")
        if self.arm.gravity_compensation:
            self.diagnostics.reject("gravity_compensation", "joint_trajectory while guided")
            return
        try:
            command = self._command(message)
            self.follower.accept(command, self.arm.time_s)
            self._followed = command, stamp_ns(message)
        except RejectedTrajectoryError as error:
            self.diagnostics.reject(error.reason, str(error))

    def _catch_up(self, pacer: Pacer) -> None:
        """Follow the last command where it is by its stamp: the physics has left out some time."""
        self._caught_up_s = pacer.dropped_s
        command, at_ns = self._followed or (None, 0)
        if command is None or not at_ns or self._publishes_clock:
            return
        moved = replace(command, start_s=self._start_s(at_ns))
        with suppress(RejectedTrajectoryError):
            self.follower.accept(moved, self.arm.time_s)

    def _on_prediction(self, spread: SpreadControl, message: JointTrajectory) -> None:
        start_s = self._start_s(stamp_ns(message))
        points = message.points
        times = [duration_s(p.time_from_start) for p in points]
        std = [p.effort for p in points]
        start_s = self.arm.time_s if start_s is None else start_s
        try:
            spread.take(start_s, message.joint_names, times, std)
        except TrajectoryError as error:
            self.diagnostics.reject("bad_prediction", str(error))

    def _command(self, message: JointTrajectory) -> TrajectoryCommand:
        points = message.points
        return TrajectoryCommand.validated(
            message.joint_names,
            [duration_s(p.time_from_start) for p in points],
            [p.positions for p in points],
            [p.velocities for p in points],
            [p.accelerations for p in points],
            start_s=self._start_s(stamp_ns(message)),
            now_s=self.arm.time_s,
            joint_names=self._robot.joint_names,
            limits=self.arm.limits,
            position=np.stack([self.arm.state().q, self.arm.reference.q]),
        )

    def _start_s(self, at_ns: int) -> float | None:
        """When a stamp is on the physics' clock [s]; None for a zero stamp."""
        if at_ns == 0:
            return None
        if self._publishes_clock:
            return at_ns * 1e-9
        if self._pacer is None:
            return self.arm.time_s + (at_ns - self.get_clock().now().nanoseconds) * 1e-9
        return (at_ns - self._zero_ns(self._pacer, self._now_s())) * 1e-9 * self._pacer.factor

    def _on_push(self, message: WrenchStamped) -> None:
        force = message.wrench.force
        push = np.array([force.x, force.y, force.z])
        if message.header.frame_id not in ("", WORLD_FRAME):
            self.diagnostics.reject("unknown_frame", f"push in {message.header.frame_id!r}")
        elif not np.all(np.isfinite(push)):
            self.diagnostics.reject("not_finite", f"push of {push.tolist()} N")
        elif np.linalg.norm(push) > LARGEST_PUSH_N:
            self.diagnostics.reject("push_too_strong", f"push of {push.tolist()} N")
        else:
            self._push_n, self._push_until = push, self.arm.n_steps + PUSH_STEPS

    def _on_gravity_compensation(
        self, request: SetBool.Request, response: SetBool.Response
    ) -> SetBool.Response:
        self.arm.set_gravity_compensation(request.data)
        self._followed = None
        if not request.data:
            self.follower.hold(self.arm.reference.q)
        else:
            self._tracking_error_rad = 0.0
        response.success = True
        response.message = "guide the arm by hand" if request.data else "holding"
        return response

    def _report(self) -> None:
        """Bring the numbers of the diagnostics up to date."""
        if self._pacer is None:
            self.diagnostics.status(Level.WARN, "waiting for /clock")
            return
        achieved = self._pacer.achieved_factor(self._now_s(), self.arm.n_steps)
        values = self.diagnostics.value
        values("real time factor", f"{achieved:.3f}")
        values("simulated time [s]", f"{self.arm.time_s:.3f}")
        values("simulated time dropped [s]", f"{self._pacer.dropped_s:.3f}")
        values("largest tracking error [rad]", f"{self._tracking_error_rad:.5f}")
        values("steps with saturated torque", self.arm.saturated_steps)
        if self.gripper is not None:
            values("held object", self.gripper.held or "none")
        values("gravity compensation", self.arm.gravity_compensation)
        values("controller", self._controller)
        values("contacts", self.surroundings.touches)
        if self.surroundings.touches:
            values("last contact", " and ".join(self.surroundings.last))
        self._tracking_error_rad = 0.0
        if self._publishes_clock and self.count_publishers("/clock") > 1:
            self.diagnostics.status(Level.ERROR, "another node publishes /clock: allow only one")
        elif achieved < 0.95 * self._pacer.factor:
            self.diagnostics.status(Level.WARN, f"slower than asked: {achieved:.2f} x real time")
        elif touching := self.surroundings.touching():
            self.diagnostics.status(Level.WARN, f"{touching[0]} touches {touching[1]}")
        else:
            self.diagnostics.status(Level.OK, "running")


main = partial(run, ArmSim)
