# SPDX-License-Identifier: Apache-2.0
"""The parameters of the node `primitive_activation`, and the settings made from them."""

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from rclpy.node import Node

from intent_recognition.activation import ActivationSettings, PretriggerSettings
from intent_recognition.array_types import Floats
from intent_recognition.demonstrations import DofEntry, numbers_of
from intent_recognition.errors import ArgumentError
from intent_recognition.kinematics import JOINT_NAMES, LWR_LIMITS, Arm, JointLimits, check_position
from intent_recognition.motion import Spread, is_hand, scaled_limits
from intent_recognition.nodes.diagnostics import RejectionError
from intent_recognition.nodes.hand_input import HandInput
from intent_recognition.nodes.parameters import DEFAULT, Changes, declare
from intent_recognition.promp import Risk, TaskLibrary, Trajectory, end_std_limits, least_end_std
from intent_recognition.recognition import (
    USUAL_THRESHOLD,
    DecisionSettings,
    learned_risk,
    start_mean,
)

if TYPE_CHECKING:
    from intent_recognition.model import Model


ARM_LIMITS = ("lower", "upper", "velocity")
"""Parameters that each replace a limit of the arm; for unknown joints all of them are needed."""
AT_REST = ("home", "acceleration_limit", "velocity_scale")
"""Parameters that may change only while no motion is under way: a plan assumes their values."""
GUARDS = (
    *("velocity_scale", "acceleration_limit", "max_wrong", "threshold", "n_observations"),
    *("max_end_std", "timeout", "max_joint_state_age", "max_tracking_error"),
)
"""Parameters that limit how fast, on what certainty and for how long the arm moves."""


class Taught(NamedTuple):
    """The tasks of a model (`library`; None without a model)."""

    library: TaskLibrary | None = None
    arm: Arm | None = None  # the arm whose hand the tasks control; None if they control joints
    # quaternion (4,) that the hand's rotation vectors start from; empty without them
    reference: tuple[float, ...] = ()

    def spreads(self, make: Callable[..., Spread]) -> dict[str, Spread]:
        """Make the spread of each task, within which paths may be bent; by label."""
        if self.library is None:
            return {}
        found = enumerate(self.library.labels)
        return {
            label: make(self.library.primitive(k), self.arm, self.reference) for k, label in found
        }


class ActivationParameters:
    """Declares the node's parameters, and makes settings from their values.

    Attributes:
        rate_hz: rate at which a running motion is updated [Hz].
        command_action: action that takes the commands; empty if the topic does.
        of_hand: whether the model predicts a hand instead of joints.
        taught_link: link of the hand that the model was taught with; empty if unknown.
        taught: tasks of the model; if they are of a hand, `describe` adds its arm.
        described: arm of `robot_description`, whose limits hold where none are given.
        entries: DOF entries of the model's controlled agent.
    """

    def __init__(self, node: Node, hand: HandInput):
        self._values, self._hand = declare(node, "activation"), hand
        self.rate_hz: float = self._values["command_rate"]
        self.command_action: str = self._values["command_action"]
        self.described: Arm | None = None
        self.of_hand, self.taught_link = False, ""
        self.taught = Taught()
        self.entries: Sequence[DofEntry] = ()
        self._decision()

    @property
    def allows_shared_arm(self) -> bool:
        """Whether other nodes may command the arm, too."""
        return bool(self._values["allow_shared_arm"])

    def changed(self, changes: Changes) -> "ActivationParameters":
        """A copy with changed values, which are checked."""
        other = copy(self)
        other._values = self._values | dict(changes)
        other._decision()
        other._check_pretrigger()
        return other

    def read_model(self) -> tuple[tuple[str, ...], dict[str, Floats]]:
        """Read the model; returns the joint names, and where each task begins, by label.

        The names are empty if they follow later, with a prediction or, for a model of the hand,
        with the arm. Its tasks begin at positions (3,) [m] or poses (7,) with a quaternion xyzw.

        Raises:
            ArgumentError: `joint_names` and the model differ, or pretriggering lacks a model.
        """
        names = tuple(name for name in self._values["joint_names"] if name)
        if self._values["model"]:
            model = _read_model(self._values["model"], names)
            self.entries = entries = model.dofs.controlled
            of_model = model.dofs.controlled_message_names
            self.of_hand = is_hand(of_model)
            self.taught = Taught(model.library)
            if self.of_hand:
                self.taught_link = entries[0].link
                self.taught = Taught(model.library, self.described, entries[-1].reference)
            starts = {}
            for k, label in enumerate(model.labels):
                mean = start_mean(model.library, k)[None]
                still = Trajectory(np.zeros(1), mean, np.zeros_like(mean), np.zeros_like(mean))
                starts[label] = numbers_of(entries, still).positions[0]
            return () if self.of_hand else of_model, starts
        self._check_pretrigger()
        return names, {}

    def describe(self, arm: Arm) -> None:
        """Set the arm of `robot_description`."""
        self.described = arm
        if self.of_hand:
            self.taught = self.taught._replace(arm=arm)

    @property
    def home(self) -> Floats | None:
        """Posture to return to [rad]; None: the first measured one."""
        return np.array(self._values["home"], dtype=np.float64) if self._values["home"] else None

    def limits_in_force(self, names: tuple[str, ...], sources: Mapping[str, str]) -> str:
        """Text of the limits and guards for a motion of these joints, each with its source."""
        shown = [f"{name} {self._values[name]} ({sources.get(name, DEFAULT)})" for name in GUARDS]
        limits = self._limits_of(names)
        for name in ARM_LIMITS:
            array = getattr(limits, name).round(4).tolist()
            unit = "rad/s, scaled" if name == "velocity" else "rad"
            known = "the LWR's" if self.described is None else "of robot_description"
            source = sources.get(name, DEFAULT) if self._values[name] else known
            shown.append(f"{name} {array} {unit} ({source})")
        return "; ".join(shown)

    def never_certain(self) -> dict[str, float]:
        """Tasks whose end never gets surer than `max_end_std`, with its least std [rad]."""
        limit, library = self._values["max_end_std"], self.taught.library
        if library is None or not limit:
            return {}
        least = (least_end_std(library, k).get("rad", 0.0) for k in range(library.n_tasks))
        return {k: std for k, std in zip(library.labels, least, strict=True) if std > limit}

    def settings(self, names: tuple[str, ...], starts: dict[str, Floats]) -> ActivationSettings:
        """Make the activation settings for these joints and starts of the tasks.

        Raises:
            RejectionError: the limits of a joint are not known.
            ArgumentError: limits or home have the wrong size.
            KinematicsError: home is outside the limits.
        """
        value = self._values
        home = self.home
        if home is not None and home.shape != (len(names),):
            cure = "One per joint [rad]."
            raise ArgumentError.about("home", f"{len(names)} angles", value["home"], cure)
        limits = self._limits_of(names)
        if home is not None:
            check_position(home, limits, names, "home")
        return ActivationSettings(
            limits=limits,
            decision=self._decision(),
            home=home,
            return_home=value["return_home"],
            pretrigger=PretriggerSettings(
                value["pretrigger_threshold"], value["pretrigger_timeout"], starts
            ),
            command_period_s=1.0 / self.rate_hz,
            timeout_s=value["timeout"],
            hold_s=value["hold_time"],
            lead_s=value["switch_lead"],
            max_joint_state_age_s=value["max_joint_state_age"],
            max_tracking_error_rad=value["max_tracking_error"],
            max_lateness_s=value["max_lateness"],
        )

    def _decision(self) -> DecisionSettings:
        value, library = self._values, self.taught.library
        return DecisionSettings(
            threshold=value["threshold"] or USUAL_THRESHOLD,
            n_observations=value["n_observations"],
            max_end_std_rad=value["max_end_std"] or None,
            learned_end_std={} if library is None else end_std_limits(library),
            release_below=value["release_below"],
            min_evidence=value["min_evidence"],
            risk=self.risk,
        )

    @property
    def risk(self) -> Risk | None:
        """Learned probability from which to act, and its error rate; None: `threshold` decides."""
        if self._values["threshold"] or self.taught.library is None:
            return None
        return learned_risk(self.taught.library, self._values["max_wrong"])

    def _check_pretrigger(self) -> None:
        value = self._values["pretrigger_threshold"]
        if value > 0.0 and not self._values["model"]:
            cure = "Set model, or leave pretrigger_threshold at 0."
            raise ArgumentError.about("pretrigger_threshold", "0 without a model", value, cure)

    def _limits_of(self, names: tuple[str, ...]) -> JointLimits:
        """Limits by the parameters, else those of the LWR by name, else by `robot_description`.

        The LWR whose hand is predicted has those of `robot_description`, too.
        """
        given = {
            name: np.array(self._values[name], dtype=np.float64)
            for name in ARM_LIMITS
            if self._values[name]
        }
        acceleration = np.full(len(names), self._values["acceleration_limit"])
        of_lwr = set(names) <= set(JOINT_NAMES) and len(set(names)) == len(names) > 0
        all_given = len(given) == len(ARM_LIMITS)
        if not (all_given or of_lwr or self.of_hand):  # an arm of a hand comes with `describe`
            self.described = self._hand.arm
        if all_given:
            no_limit = np.full(len(names), 1e9)  # plans do not use torques
            limits = JointLimits(**given, acceleration=acceleration, torque=no_limit)
        elif self.described is not None and names == self.described.joint_names:
            limits = replace(self.described.limits, **given, acceleration=acceleration)
        elif of_lwr:
            at = [JOINT_NAMES.index(name) for name in names]
            lwr = LWR_LIMITS
            known = JointLimits(
                lwr.lower[at], lwr.upper[at], lwr.velocity[at], acceleration, lwr.torque[at]
            )
            limits = replace(known, **given)
        else:
            cure = "set lower, upper and velocity for joints not of the LWR"
            if self.described is not None:
                joints = ", ".join(self.described.joint_names)
                cure = f"robot_description moves {joints}: take a model of this arm"
            raise RejectionError("wrong_joint_names", f"{', '.join(names)}: {cure}")
        return scaled_limits(limits, self._values["velocity_scale"])


def _read_model(path: str, names: tuple[str, ...]) -> "Model":
    from intent_recognition.model import load_model

    model = load_model(path)
    of_model = model.dofs.controlled_message_names
    if names and names != of_model and not is_hand(of_model):
        expected = f"those of the model {path}: {of_model}"
        raise ArgumentError.about("joint_names", expected, names, "Leave one away.")
    return model
