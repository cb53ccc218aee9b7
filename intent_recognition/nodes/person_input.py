# SPDX-License-Identifier: Apache-2.0
"""What bounds the speed of the arm: where people are predicted to be, and places to pass slowly."""

from functools import partial

import numpy as np
from rclpy.node import Node
from trajectory_msgs.msg import JointTrajectory

from intent_recognition.errors import ArgumentError, IntentError
from intent_recognition.kinematics import Arm
from intent_recognition.motion import (
    PredictedPerson,
    Separation,
    SeparationSettings,
    SlowPlaces,
    parse_places,
)
from intent_recognition.nodes import qos
from intent_recognition.nodes.conversions import stamp_ns, trajectory_arrays
from intent_recognition.nodes.diagnostics import Diagnostics
from intent_recognition.nodes.hand_input import HandInput
from intent_recognition.nodes.parameters import declare
from intent_recognition.nodes.prediction_input import RejectionError

TOPIC = "intent/human_trajectory"


class PersonInput:
    """Keeps the newest tube of each person's tracked point, from `intent/human_trajectory`.

    Args:
        diagnostics: counts what cannot be used under `bad_human_trajectory`.

    Attributes:
        people: in the frame of the URDF's root link; those of whom something is predicted.
        separation: slows plans near people; None where that is not asked for, or as long as the
            arm is not known.
        slow_places: likewise.
    """

    def __init__(self, node: Node, hand: HandInput, diagnostics: Diagnostics) -> None:
        self._hand, self._diagnostics = hand, diagnostics
        values = declare(node, "person")
        dofs: list[str] = values["person_dofs"]
        self._dofs = [name for name in dofs if name]
        self._offset = values["person_offset"]
        self._settings = SeparationSettings(
            human_speed_m_s=values["human_speed"],
            intrusion_m=values["intrusion"],
            least_speed_m_s=values["least_speed"],
        )
        if len(self._dofs) not in (0, 3) or len(self._offset) != 3:
            got = f"{len(self._dofs)}, and {len(self._offset)} in person_offset"
            cure = "Name x, y and z: `intent inspect MODEL` lists them."
            raise ArgumentError.about("person_dofs", "3 names, or none", got, cure)
        self._places = parse_places(values["slow_at"])
        self._node = node
        self._people: dict[str, PredictedPerson] = {}
        self.people: tuple[PredictedPerson, ...] = ()
        self.separation: Separation | None = None
        self.slow_places: SlowPlaces | None = None
        self._arm: Arm | None = None

    def hear(self, person: str, topic: str = TOPIC) -> None:
        """Subscribe to the prediction of one more person, where the parameters ask for it."""
        if self._dofs:
            take = partial(self._take, person)
            self._node.create_subscription(JointTrajectory, topic, take, qos.COMMAND)

    def update(self, names: tuple[str, ...]) -> bool:
        """Whether `separation` and `slow_places` are others than before.

        Raises:
            RejectionError: the arm is to slow, and is not known.
        """
        if not self._dofs and not len(self._places):
            return False
        arm = self._hand.arm
        if arm is None:
            raise RejectionError(
                "no_robot_description", "person_dofs or slow_at is set, but for which arm?"
            )
        if arm.joint_names != names:
            text = f"robot_description moves {', '.join(arm.joint_names)}, not {', '.join(names)}"
            raise RejectionError("wrong_joint_names", text)
        new, self._arm = self._arm is not arm, arm
        if new and self._dofs:
            self.separation = Separation(arm, self._settings)
        if new and len(self._places):
            self.slow_places = SlowPlaces(arm, self._places)
        return new

    def _take(self, who: str, message: JointTrajectory) -> None:
        self._diagnostics.tick(TOPIC)
        try:
            times_s, positions, rest = trajectory_arrays(message)
            names = list(message.joint_names)
            columns = [names.index(name) for name in self._dofs]
            if np.all(times_s == times_s[-1:]):  # the movement is at its end
                times_s, positions = times_s[-1:], positions[-1:]
                rest = {name: values[-1:] for name, values in rest.items()}
            if not len(times_s) or np.any(np.diff(times_s) <= 0.0):
                got = f"{len(times_s)} that do not" if len(times_s) else "none"
                cure = "Check the sender."
                raise ArgumentError.about(TOPIC, "points whose times increase", got, cure)
            mean, std = positions[:, columns], rest["effort"][:, columns]
            if not (np.all(np.isfinite(mean)) and np.all(np.isfinite(std))):
                raise ArgumentError.about(TOPIC, "finite numbers", "NaN", "Check the sender.")
        except (IntentError, KeyError, ValueError) as error:
            self._people.pop(who, None)
            self.people = tuple(self._people.values())
            self._diagnostics.reject("bad_human_trajectory", f"{TOPIC}: {error}")
            return
        times_ns = stamp_ns(message) + np.rint(times_s * 1e9).astype(np.int64)
        # The root of the trace: at least what the least certain direction has.
        self._people[who] = PredictedPerson(
            times_ns, mean + np.array(self._offset), np.linalg.norm(std, axis=1)
        )
        self.people = tuple(self._people.values())
