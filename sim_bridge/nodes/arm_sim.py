# SPDX-License-Identifier: Apache-2.0
"""The node `arm_sim`: a torque-controlled arm in PyBullet, 1 kHz physics."""

import os
from functools import partial
from typing import Any

import numpy as np
from geometry_msgs.msg import WrenchStamped
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.time import Time
from rosgraph_msgs.msg import Clock as ClockMessage
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import SetBool
from trajectory_msgs.msg import JointTrajectory

from intent_recognition.errors import ArgumentError, ResourceBusyError
from intent_recognition.kinematics import JOINT_NAMES, parse_boxes
from intent_recognition.nodes.diagnostics import Diagnostics, Level
from intent_recognition.nodes.parameters import declare
from intent_recognition.nodes.qos import COMMAND, FEEDBACK, LATCHED, SENSOR, STATE, each_of
from intent_recognition.nodes.runtime import run, steady_timer
from intent_recognition.registry import ANSWERS
from sim_bridge.arm import (
    PERSON,
    Robot,
    SensorNoise,
    SimulatedArm,
    SpreadControl,
    Surroundings,
    find_robot,
)
from sim_bridge.handover import GRIP_M, with_fingers
from sim_bridge.nodes.arm_commands import ArmCommands
from sim_bridge.nodes.clock_answers import ClockAnswers
from sim_bridge.nodes.physics_clock import PhysicsClock
from sim_bridge.nodes.pouring_scene import POURING, PouringScene
from sim_bridge.nodes.transfer_scene import TAKES, TRANSFERS, UPDATE_EVERY, TransferScene
from sim_bridge.scenarios.toolbox import HOME


class ArmSim(Node):
    """Simulates an arm; physics is paced by a steady clock.

    In: `joint_trajectory`; `~/push` (a force at the hand in world axes, held for 0.1 s after
    each message; torques are ignored); `~/gravity_compensation`; `intent/active_task`, for the
    objects of the `scene`, which the hand takes and gives; `intent/robot_trajectory`, whose
    standard deviations set the stiffness if `controller` is "stochastic_feedback". Out:
    `joint_states`, `robot_description`, `/clock` if `publish_clock`, `/diagnostics`.

    Stamps are simulated time (from zero at start) if `publish_clock`, else ROS time. With
    `use_sim_time` and another node's `/clock`, the physics follows that clock.

    Joints outside the chain of the arm, such as fingers, come after those of the chain in
    `joint_states`; the scene moves them.

    Attributes:
        commands: controls the arm as messages command.
        scene: handles the objects in the arm's world; None without objects.
    """

    def __init__(self, name: str = "arm_sim", robot: Robot | None = None, **kwargs: Any) -> None:
        super().__init__(name, **kwargs)
        self._given = given = declare(self, "arm")
        declare(self, "people")  # read by the scene of transfers
        pouring = PouringScene(self)
        boxes = parse_boxes(given["boxes"])
        self._answering: list[str] = given["wait_for_answers"]
        if self._answering and not given["publish_clock"]:
            cure = "Set publish_clock, or leave it empty."
            raise ArgumentError.about("wait_for_answers", "publish_clock", self._answering, cure)
        lever_m = 0.0 if robot is None else GRIP_M  # from the taught hand to the grip
        if robot is None:
            values = declare(self, "robot")
            place = values["base_position"] or None
            robot = find_robot(values["robot"], tip=values["tip"], base_position_m=place)
        transfers = given["scene"] == TRANSFERS
        self.arm = self._make_arm(with_fingers(robot) if transfers else robot, pouring)
        self.surroundings = Surroundings(self.arm, boxes)
        self.diagnostics = Diagnostics(self)
        factor, rate_hz = given["real_time_factor"], given["joint_state_rate"]
        self.clock = PhysicsClock(self, self.arm, factor, given["publish_clock"], rate_hz)
        stiffens = given["controller"] == "stochastic_feedback"
        spread = SpreadControl(self.arm.robot.joint_names) if stiffens else None
        self.commands = ArmCommands(self.arm, self.clock, self.diagnostics, spread)
        self.arm.before_step.append(self._look_at_scene)
        takes = {"joint_trajectory", *(TAKES if transfers else ())}
        takes |= {"intent/active_task"} if given["scene"] != "none" else set()
        self._answers = ClockAnswers(self, self._answering, self.diagnostics, takes)
        self.scene = self._make_scene(pouring, lever_m)
        self._tracking_error_rad = 0.0
        self._others = self.arm.others.names
        self._message = JointState(name=[*self.arm.robot.joint_names, *self._others])
        self._make_topics()
        if self._answering:
            self.create_subscription(JointState, ANSWERS, self._on_answer, FEEDBACK)
        self.add_post_set_parameters_callback(self._on_parameters)
        steady_timer(self, 0.002, self._tick)  # half a joint state
        steady_timer(self, 0.5, self._report)

    def destroy_node(self) -> None:
        """Destroy the node and close its world."""
        super().destroy_node()
        self.arm.close()

    def _make_arm(self, robot: Robot, pouring: PouringScene) -> SimulatedArm:
        given = self._given
        if not given["headless"] and not os.environ.get("DISPLAY"):
            cure = "Set headless:=true."
            raise ResourceBusyError.about("headless", "a display for the window", "none", cure)
        initial = given["initial_position"]
        if not initial and given["scene"] == POURING:
            initial = pouring.posture
        elif not initial:
            initial = HOME if robot.joint_names == JOINT_NAMES else None
        return SimulatedArm(
            initial,
            robot=robot,
            stiffness_scale=given["stiffness_scale"],
            noise=SensorNoise() if given["sensor_noise"] else None,
            rng=np.random.default_rng(given["seed"]),
            headless=given["headless"],
        )

    def _make_scene(
        self, pouring: PouringScene, lever_m: float
    ) -> PouringScene | TransferScene | None:
        name, seed, stamp = self._given["scene"], self._given["seed"], self.clock.stamp
        if name == TRANSFERS:
            note = self._answers.note
            return TransferScene(self, self.arm, seed, lever_m, stamp, self.diagnostics, note)
        return pouring.begin(self.arm, seed, stamp) if name == POURING else None

    def _make_topics(self) -> None:
        self._states = self.create_publisher(JointState, "joint_states", STATE)
        description = self.create_publisher(String, "robot_description", LATCHED)
        description.publish(String(data=self.arm.robot.description))
        self._clock_out = None
        if self.clock.publishes:
            self._clock_out = self.create_publisher(ClockMessage, "/clock", STATE)
        listen = self.create_subscription
        commands = listen(
            JointTrajectory, "joint_trajectory", self._on_trajectory, each_of(COMMAND)
        )
        self.diagnostics.watch(commands, "joint_trajectory")
        if self.scene is not None:
            take_task = partial(self._on_task, self.scene)
            listen(String, "intent/active_task", take_task, each_of(LATCHED))
        if self.commands.spread is not None:
            take = self.commands.take_prediction
            listen(JointTrajectory, "intent/robot_trajectory", take, COMMAND)
        listen(WrenchStamped, "~/push", self.commands.push, SENSOR)
        self.create_service(SetBool, "~/gravity_compensation", self._on_gravity_compensation)

    def _on_parameters(self, parameters: list[Parameter]) -> None:
        for changed in parameters:
            if changed.name == "real_time_factor" and not self.clock.follows:
                now_s, n_done = self.clock.now_s(), self.arm.n_steps
                self.clock.pacer.change_factor(changed.value, now_s, n_done)

    def _look_at_scene(self, arm: SimulatedArm) -> None:
        if self.scene is not None and arm.n_steps % UPDATE_EVERY == 0:
            self.scene.update()

    def _on_task(self, scene: PouringScene | TransferScene, message: String) -> None:
        self._answers.note("intent/active_task")
        scene.set_task(message.data)

    def _tick(self) -> None:
        """Do the steps that are due, and publish after each that ends a period."""
        if not self._answers.begun:
            return
        n_due = self.clock.due()
        self.commands.catch_up()
        if n_due == 0:
            return
        zero_ns = self.clock.zero_ns()
        for _ in range(n_due):
            if self._answers.wait():
                return
            self.arm.step()
            if self.clock.ends_period():
                self._publish(self.clock.stamp_ns(zero_ns))

    def _on_answer(self, message: JointState) -> None:
        self._answers.hear(message)
        if self._answers.all_came():
            self._tick()

    def _publish(self, stamp_ns: int) -> None:
        stamp = Time(nanoseconds=stamp_ns).to_msg()
        state = self.arm.state()
        message = self._message
        message.header.stamp = stamp
        n_others = len(self._others)
        message.position = state.q.tolist() + self.arm.others.positions()
        message.velocity = state.qd.tolist() + [0.0] * n_others
        message.effort = state.torque.tolist() + [0.0] * n_others
        if self._clock_out is not None:
            self._clock_out.publish(ClockMessage(clock=stamp))
        self._states.publish(message)
        self._answers.note("/clock")
        self._answers.note("joint_states")
        self.diagnostics.tick("joint_states")
        if not self.arm.gravity_compensation:
            error = float(np.abs(self.arm.reference.position - state.q).max())
            self._tracking_error_rad = max(self._tracking_error_rad, error)

    def _on_trajectory(self, message: JointTrajectory) -> None:
        self.diagnostics.tick("joint_trajectory")
        self._answers.note("joint_trajectory")
        self.commands.take(message)

    def _on_gravity_compensation(
        self, request: SetBool.Request, response: SetBool.Response
    ) -> SetBool.Response:
        self.commands.guide(request.data)
        if request.data:
            self._tracking_error_rad = 0.0
        response.success = True
        response.message = "guide the arm by hand" if request.data else "holding"
        return response

    def _report(self) -> None:
        pacer, values = self.clock.pacer, self.diagnostics.value
        if not self._answers.begun:
            self.diagnostics.status(Level.WARN, f"time begins with {PERSON} (wait_for_answers)")
        if not pacer.begun:
            return
        achieved = pacer.achieved_factor(self.clock.now_s(), self.arm.n_steps)
        values("real time factor", f"{achieved:.3f}")
        values("simulated time [s]", f"{self.arm.time_s:.3f}")
        values("simulated time dropped [s]", f"{pacer.dropped_s:.3f}")
        values("largest tracking error [rad]", f"{self._tracking_error_rad:.5f}")
        values("steps with saturated torque", self.arm.saturated_steps)
        if self.scene is not None:
            values("held object", self.scene.held or "none")
        values("gravity compensation", self.arm.gravity_compensation)
        values("controller", self._given["controller"])
        values("contacts", self.surroundings.touches)
        if self.surroundings.touches:
            values("last contact", " and ".join(self.surroundings.last))
        self._tracking_error_rad = 0.0
        if self.clock.publishes and self.count_publishers("/clock") > 1:
            self.diagnostics.status(Level.ERROR, "another node publishes /clock: allow only one")
        elif achieved < 0.95 * pacer.factor:
            self.diagnostics.status(Level.WARN, f"slower than asked: {achieved:.2f} x real time")
        elif touching := self.surroundings.touching():
            self.diagnostics.status(Level.WARN, f"{touching[0]} touches {touching[1]}")
        else:
            self.diagnostics.status(Level.OK, "running")


main = partial(run, ArmSim)
