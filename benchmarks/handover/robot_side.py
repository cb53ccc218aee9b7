# SPDX-License-Identifier: Apache-2.0
"""The robot in a transfer: what it measures, how it moves, and what its fingers do.

It sees its own joints and fingers through their sensors, and where a tracker sees the person's
hand; nothing else of the world.
"""

from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from benchmarks.handover.cell import TransferCell
from intent_recognition.array_types import Floats
from intent_recognition.transfer import (
    Holding,
    LoadEstimator,
    Request,
    Situation,
    TransferMachine,
    TransferOutput,
    away_from_base,
)
from sim_bridge.arm import TIME_STEP_S, SimulatedArm
from sim_bridge.handover import GripFollower, progress

SAMPLE_STEPS = 5
"""Physics steps between two joint states: 200 Hz, as `arm_sim` publishes them."""
HAND_M = 0.1
"""The person's hand is at the object within its length and this distance from the grip [m]."""
TRACKED_STD_M = 0.002
"""Standard deviation of the tracker's noise [m]."""


class TransferSample(NamedTuple):
    """What was measured and done at one time, for scores and figures.

    Attributes:
        time_s: of the joint state.
        force_n: estimated, on the robot's hand (3,).
        output: of the machine.
        person_n: true force of the person on the object (3,).
        fingers: how many touch the object.
        grip_m: where the grip is (3,).
        object_m: where the object is (3,).
        object_m_s: how it moves (3,).
    """

    time_s: float
    force_n: Floats
    output: TransferOutput
    person_n: Floats
    fingers: int
    grip_m: Floats
    object_m: Floats
    object_m_s: Floats


class RobotSide:
    """The robot of a cell; a hook of its steps.

    Args:
        cell: the physics.
        rng: of the tracker's noise.
        machine: decides; of its own if None.

    Attributes:
        request: what it is about to do; set it.
        samples: of every joint state.
    """

    def __init__(
        self, cell: TransferCell, rng: np.random.Generator, machine: TransferMachine | None = None
    ) -> None:
        self._cell, self._rng = cell, rng
        self.machine = machine or TransferMachine()
        self._estimator = LoadEstimator(cell.model)
        self.request = Request.NOTHING
        self.samples: list[TransferSample] = []
        self.move(np.array([cell.home, cell.home]), 0.0)
        self._grip = GripFollower(cell.arm, cell.fingers)
        cell.arm.before_step.append(self._step)

    @property
    def holding(self) -> Holding:
        """The machine's state."""
        return self.machine.holding

    @property
    def moving(self) -> bool:
        """Whether it is under way."""
        return self._cell.arm.time_s < self._start_s + self._length_s

    def move(self, way: Floats, length_s: float) -> None:
        """Go along postures (k, n), beginning and ending at rest, by minimum jerk."""
        self._start_s, self._length_s = self._cell.arm.time_s, max(length_s, TIME_STEP_S)
        self._way = CubicSpline(np.linspace(0.0, 1.0, len(way)), way)

    def _step(self, arm: SimulatedArm) -> None:
        tau = min((arm.time_s - self._start_s) / self._length_s, 1.0)
        rate = 30.0 * tau**2 * (1.0 - tau) ** 2 / self._length_s
        bend = 60.0 * tau * (1.0 - 3.0 * tau + 2.0 * tau**2) / self._length_s**2
        s = progress(tau)
        slope, curve = self._way(s, 1), self._way(s, 2)
        arm.set_reference(self._way(s), slope * rate, slope * bend + curve * rate**2)
        if arm.n_steps % SAMPLE_STEPS == 0:
            self._sample(arm)

    def _sample(self, arm: SimulatedArm) -> None:
        state, cell = arm.state(), self._cell
        force = self._estimator.update(state.time_s, state.q, state.qd, state.torque)
        near, toward, speed = self._look(state.q)
        situation = Situation(
            state.time_s,
            force,
            self.moving,
            self._estimator.speed_m_s,
            cell.fingers.half_opening_m(),
            near,
            speed,
            toward,
            self._estimator.rise_m_s2,
            self._estimator.doubt_n,
        )
        output = self.machine.step(self.request, situation)
        asked = output.holding, output.share, output.weight_n, output.grip_n
        self._grip.follow(*asked, SAMPLE_STEPS * TIME_STEP_S)
        person = np.zeros(3) if cell.person is None else cell.person.force_n.copy()
        self.samples.append(
            TransferSample(
                state.time_s,
                force.copy(),
                output,
                person,
                cell.fingers.touching(cell.body),
                cell.grip_m(),
                cell.held.pose()[0],
                cell.held.speed_m_s(),
            )
        )

    def _look(self, q: Floats) -> tuple[bool, Floats | None, float]:
        """Whether the tracked hand is near, the way to it, and its speed."""
        person = self._cell.person
        if person is None:
            return False, None, 0.0
        seen = person.position_m + TRACKED_STD_M * self._rng.standard_normal(3)
        away_m = seen - self._cell.model.forward_kinematics(q)[:3, 3]
        length_m = 2.0 * self._cell.thing.half_edges_m[2]
        near = bool(np.linalg.norm(away_m) < length_m + HAND_M)
        return near, away_from_base(seen), float(np.linalg.norm(person.velocity_m_s))
