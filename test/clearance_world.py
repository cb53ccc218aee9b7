# SPDX-License-Identifier: Apache-2.0
"""The LWR on a straight joint path, a primitive that may vary about it, boxes and people."""

import numpy as np
from activation_world import LIMITS, trajectory

from intent_recognition.gaussian import Gaussian
from intent_recognition.kinematics import JOINT_NAMES, Arm, Bodies, Box, hand_position
from intent_recognition.motion import (
    Clearance,
    JointReference,
    NominalTiming,
    PredictedPerson,
    Spread,
    make_path,
    plan_interaction,
)
from intent_recognition.promp import InteractionProMP, NormalizedRBFBasis
from sim_bridge.arm import TrajectoryCommand, find_robot

ROBOT = find_robot("lwr")
ARM = Arm.from_urdf(ROBOT.description, tip=ROBOT.tip)
BASIS = NormalizedRBFBasis(10)
TIMES, POSITIONS = trajectory("plate")
PATH = make_path(TIMES, POSITIONS, LIMITS)
MIDDLE = hand_position(PATH.spline(0.5))
FAR_M = np.array([5.0, 0.0, 0.5])


def plan_along(path=PATH, ceiling=None):
    """A plan along a path in its own time, from rest."""
    start, timing = JointReference.at_rest(path.spline(0.0)), NominalTiming(0.0, path.duration_s)
    return plan_interaction(path, timing, start, LIMITS, rate_ceiling=ceiling)


def hand_of(plan):
    """Where the hand is (T, 3) [m], and its speed (T,) [m/s], every ms."""
    hand_m = ARM.forward_kinematics(plan.sampled(np.arange(0.0, plan.duration_s, 1e-3))[0])
    hand_m = hand_m[:, :3, 3]
    return hand_m, np.linalg.norm(np.gradient(hand_m, 1e-3, axis=0), axis=1)


def accept(plan, position=None):
    """What the simulated arm makes of a plan; raises if it does not take it."""
    return TrajectoryCommand.validated(
        JOINT_NAMES, plan.times_s, plan.positions, plan.velocities, position=position
    )


def person(position, std=0.0):
    """Somebody who stays where they are."""
    times_ns = np.array([0, 10_000_000_000])
    return PredictedPerson(times_ns, np.tile(position, (2, 1)), np.full(2, std))


def primitive(n_dofs=7, std=0.1):
    """One observed DOF, and controlled ones that vary smoothly and independently."""
    centers = np.linspace(0.0, 1.0, 10)
    smooth = np.exp(-0.5 * ((centers[:, None] - centers) / 0.12) ** 2) + 1e-6 * np.eye(10)
    covariance = np.kron(np.eye(1 + n_dofs), std**2 * smooth)
    weights = Gaussian(np.zeros(len(covariance)), covariance)
    return InteractionProMP(BASIS, weights, 1, np.full(1 + n_dofs, 1e-6), 2.0)


def bodies_among(*boxes, clearance_m=0.02):
    return Bodies(ROBOT.description, ROBOT.joint_names, boxes, clearance_m=clearance_m)


def clearance(*boxes, largest=3.0, spreads=None, **settings):
    spreads = {"plate": Spread.of(primitive())} if spreads is None else spreads
    return Clearance(bodies_among(*boxes), spreads, largest, **settings)


def box_beside(depth_m, size=0.06):
    """A box below the middle of the hand's path, the deeper in its way the greater the depth."""
    return Box("crate", tuple(MIDDLE + [0.0, 0.0, depth_m - 0.12 - size / 2.0]), (size,) * 3)
