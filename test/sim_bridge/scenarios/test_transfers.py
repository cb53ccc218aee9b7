# SPDX-License-Identifier: Apache-2.0
"""The toolbox's objects between fingers and a worker's hand, with the product's transfers."""

import numpy as np
import pytest

from intent_recognition.kinematics import Arm
from intent_recognition.signals import homogeneous
from intent_recognition.transfer import Holding, LoadEstimator, Request, Situation, away_from_base
from intent_recognition.transfer.machine import TransferMachine
from sim_bridge.arm import SensorNoise, SimulatedArm, find_robot
from sim_bridge.coworker import HOLD, PLATE, SCREW
from sim_bridge.handover import GRIP_M, with_fingers
from sim_bridge.scenarios.toolbox import STANDS_M, ToolboxTransfers, arm_posture, stand_pose
from sim_bridge.scenarios.toolbox.scene import handover_point, handover_rotation
from sim_bridge.scenarios.toolbox.transfers import Holder

WRIST_M = np.array([0.80, 0.0, 0.32])


class Cell:
    """The LWR at a handover, before a worker whose wrist rests."""

    def __init__(self, task: str, seed: int, worker: bool = True, off_m=(0.0, 0.0, 0.0)) -> None:
        self.task, self.told = task, []
        robot = with_fingers(find_robot("lwr"))
        hand_m = handover_point(task, WRIST_M) + off_m
        there = arm_posture(homogeneous(handover_rotation(task), hand_m))
        begin = arm_posture(stand_pose(task)) if task in STANDS_M else there
        rng = np.random.default_rng(seed)
        self.arm = SimulatedArm(begin, robot=robot, noise=SensorNoise(), rng=rng)
        model = Arm.from_urdf(robot.urdf, tip=robot.tip, rest=robot.ready)
        self.load, self.machine = LoadEstimator(model), TransferMachine()
        self.world = ToolboxTransfers(self.arm, seed, GRIP_M, self._tell)
        self.world.move_wrist(WRIST_M if worker else WRIST_M + [0.5, 0.0, 0.0])
        self.begin, self.there = begin, there
        self.holders: list[Holder] = []
        self.arm.before_step.append(self._step)

    def _tell(self, holds: bool) -> None:
        self.told.append(holds)
        self.machine.carry() if holds else self.machine.drop()

    def _step(self, arm: SimulatedArm) -> None:
        share = min(max(arm.time_s - 0.2, 0.0) / 2.0, 1.0)
        blend = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
        arm.set_reference(self.begin + blend * (self.there - self.begin))
        if arm.n_steps % 5:
            return
        self.world.update()
        state = arm.state()
        force = self.load.update(state.time_s, state.q, state.qd, state.torque)
        request = Request.TAKE if self.task == HOLD else Request.GIVE
        half_m = float(np.mean(arm.others.positions()))
        toward = away_from_base(WRIST_M)
        speed_m_s = self.load.speed_m_s
        now = Situation(
            state.time_s, force, share < 1.0, speed_m_s, half_m, near=True, toward=toward
        )
        out = self.machine.step(request, now)
        self.world.follow(out.holding, out.share, out.weight_n, out.grip_n)
        contact = self.world.contact()
        if self.holders[-1:] != [contact.holder]:
            self.holders.append(contact.holder)

    def hand_over(self, to: Holder) -> None:
        """Begin the task, and go on until that one alone has the object."""
        self.world.set_task(self.task)
        self.run(lambda: self.holders[-1:] == [to])
        assert self.holders[-1] is to

    def run(self, until, longest_s=9.0) -> None:
        while not until() and self.arm.time_s < longest_s:
            self.arm.step()


@pytest.fixture
def cell():
    made = []

    def make(*arguments, **named) -> Cell:
        made.append(Cell(*arguments, **named))
        return made[-1]

    yield make
    for one in made:
        one.arm.close()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("task", "off_m"), [(PLATE, (0.0, 0.0, 0.0)), (SCREW, (0.1, 0.15, 0.0))], ids=["front", "side"]
)
def test_the_worker_pulls_and_has_the_object(cell, task, off_m):
    """It is pulled away from the arm, also where the wrist is beside the fingers."""
    one = cell(task, 3, off_m=off_m)
    one.hand_over(Holder.PERSON)
    held = [holder for holder in one.holders if holder is not Holder.NOBODY]  # fingers closing
    assert held == [Holder.ROBOT, Holder.BOTH, Holder.PERSON]
    assert one.told == [True]
    one.world.set_task("")
    assert one.world.contact().holder is Holder.NONE


@pytest.mark.slow
def test_the_robot_closes_on_what_the_worker_brings_and_has_it(cell):
    one = cell(HOLD, 20, off_m=(0.0, -0.04, 0.0))  # more than their opening
    one.hand_over(Holder.ROBOT)
    assert one.holders[0] is Holder.PERSON
    assert Holder.NOBODY not in one.holders
    one.world.set_task("")
    assert one.told == [False]


@pytest.mark.slow
def test_a_worker_gives_way_to_fingers_that_closed_too_early_and_comes_again(cell):
    one = cell(HOLD, 3)
    one.world.move_wrist(WRIST_M + [0.3, 0.0, 0.0])
    one.world.set_task(HOLD)
    one.run(lambda: one.machine.holding is Holding.CLOSING)
    one.world.move_wrist(WRIST_M)
    narrowest_m = 1.0

    def taken() -> bool:
        nonlocal narrowest_m
        narrowest_m = min(narrowest_m, float(np.mean(one.arm.others.positions())))
        return one.holders[-1:] == [Holder.ROBOT]

    one.run(taken, 12.0)
    assert narrowest_m < 0.002  # they closed on nothing
    assert one.holders[-1] is Holder.ROBOT
    assert Holder.NOBODY not in one.holders


@pytest.mark.slow
def test_what_nobody_takes_stays_between_the_fingers(cell):
    one = cell(PLATE, 3, worker=False)
    one.world.set_task(PLATE)
    one.run(lambda: False, 4.0)
    assert one.holders[-1] is Holder.ROBOT
    assert Holder.PERSON not in one.holders
    one.world.set_task(SCREW)  # put away, and told
    assert one.told == [True, False]
