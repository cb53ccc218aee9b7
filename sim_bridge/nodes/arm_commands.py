# SPDX-License-Identifier: Apache-2.0
"""Commands of a simulated arm: trajectories, predictions, pushes, and guiding by hand."""

from contextlib import suppress
from dataclasses import replace

import numpy as np
from geometry_msgs.msg import WrenchStamped
from trajectory_msgs.msg import JointTrajectory

from intent_recognition.errors import TrajectoryError
from intent_recognition.nodes.conversions import duration_s, stamp_ns
from intent_recognition.nodes.diagnostics import Diagnostics
from sim_bridge.arm import (
    RejectedTrajectoryError,
    SimulatedArm,
    SpreadControl,
    TrajectoryCommand,
    TrajectoryFollower,
)
from sim_bridge.nodes.physics_clock import PhysicsClock


class ArmCommands:
    """Takes messages and controls the arm before each step; `spread` uses predictions, if given."""

    def __init__(
        self,
        arm: SimulatedArm,
        clock: PhysicsClock,
        diagnostics: Diagnostics,
        spread: SpreadControl | None,
    ) -> None:
        self._arm, self._clock, self._diagnostics, self.spread = arm, clock, diagnostics, spread
        self.follower = TrajectoryFollower(arm.reference.position, arm.limits)
        self._followed: tuple[TrajectoryCommand, int] | None = None
        self._caught_up_s = 0.0
        self._push_n, self._push_until = np.zeros(3), 0
        arm.before_step.append(self._control)

    def _control(self, arm: SimulatedArm) -> None:
        if not arm.gravity_compensation:
            arm.set_reference(*self.follower.sample(arm.time_s))
        if self.spread is not None:
            self.spread.control(arm)
        if arm.n_steps < self._push_until:
            arm.apply_force(self._push_n)

    def take(self, message: JointTrajectory) -> None:
        """Follow a trajectory, unless the arm is guided."""
        if self._arm.gravity_compensation:
            self._diagnostics.reject("gravity_compensation", "joint_trajectory while guided")
            return
        points, at_ns = message.points, stamp_ns(message)
        try:
            command = TrajectoryCommand.validated(
                message.joint_names,
                [duration_s(p.time_from_start) for p in points],
                [p.positions for p in points],
                [p.velocities for p in points],
                [p.accelerations for p in points],
                start_s=self._clock.start_s(at_ns),
                now_s=self._arm.time_s,
                joint_names=self._arm.robot.joint_names,
                limits=self._arm.limits,
                position=np.stack([self._arm.state().q, self._arm.reference.position]),
            )
            self.follower.accept(command, self._arm.time_s)
            self._followed = command, at_ns
        except RejectedTrajectoryError as error:
            self._diagnostics.reject(error.reason, str(error))

    def catch_up(self) -> None:
        """Resume the last command at the point of its stamp, if the physics has dropped time."""
        if self._clock.pacer.dropped_s <= self._caught_up_s + 0.02:  # 0.04 rad of a fast motion
            return
        self._caught_up_s = self._clock.pacer.dropped_s
        command, at_ns = self._followed or (None, 0)
        if command is not None and at_ns and not self._clock.publishes:
            moved = replace(command, start_s=self._clock.start_s(at_ns))
            with suppress(RejectedTrajectoryError):
                self.follower.accept(moved, self._arm.time_s)

    def take_prediction(self, message: JointTrajectory) -> None:
        """Set the stiffness from the standard deviations of a prediction."""
        if self.spread is None:
            return
        start_s = self._clock.start_s(stamp_ns(message))
        times = [duration_s(p.time_from_start) for p in message.points]
        std = [p.effort for p in message.points]
        try:
            begins_s = self._arm.time_s if start_s is None else start_s
            self.spread.take(begins_s, message.joint_names, times, std)
        except TrajectoryError as error:
            self._diagnostics.reject("bad_prediction", str(error))

    def push(self, message: WrenchStamped) -> None:
        """Push the hand for 0.1 s."""
        force = message.wrench.force
        push = np.array([force.x, force.y, force.z])
        if message.header.frame_id not in ("", "world"):
            self._diagnostics.reject("unknown_frame", f"push in {message.header.frame_id!r}")
        elif not np.all(np.isfinite(push)):
            self._diagnostics.reject("not_finite", f"push of {push.tolist()} N")
        elif np.linalg.norm(push) > 500.0:
            self._diagnostics.reject("push_too_strong", f"push of {push.tolist()} N")
        else:
            self._push_n, self._push_until = push, self._arm.n_steps + 100

    def guide(self, enabled: bool) -> None:
        """Let the arm be guided by hand, or hold it where it is."""
        self._arm.set_gravity_compensation(enabled)
        self._followed = None
        if not enabled:
            self.follower.hold(self._arm.reference.position)
