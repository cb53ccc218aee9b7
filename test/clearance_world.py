# SPDX-License-Identifier: Apache-2.0
"""The LWR on a straight joint path, a primitive that may vary about it, and boxes beside it."""

import numpy as np
from activation_world import LIMITS, trajectory

from intent_recognition.gaussian import Gaussian
from intent_recognition.kinematics import Bodies, Box, hand_position
from intent_recognition.motion import Clearance, Spread, make_path
from intent_recognition.promp import InteractionProMP, NormalizedRBFBasis
from sim_bridge.arm.robots import find_robot

ROBOT = find_robot("lwr")
BASIS = NormalizedRBFBasis(10)
TIMES, POSITIONS = trajectory("plate")
PATH = make_path(TIMES, POSITIONS, LIMITS)
MIDDLE = hand_position(PATH.spline(0.5))


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
