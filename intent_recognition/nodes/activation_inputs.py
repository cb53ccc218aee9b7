# SPDX-License-Identifier: Apache-2.0
"""Inputs of `primitive_activation` besides predictions: scene, people, corrections, transfers."""

import time
from collections import deque
from functools import partial
from pathlib import Path

import numpy as np
from rclpy.node import Node
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from intent_recognition.activation import ArmClock
from intent_recognition.errors import ArgumentError, IntentError
from intent_recognition.kinematics import Arm, Bodies, Box, parse_boxes
from intent_recognition.motion import (
    Clearance,
    Correction,
    DeviationDetector,
    PredictedPerson,
    Separation,
    SeparationSettings,
    SlowPlaces,
    Spread,
    parse_places,
)
from intent_recognition.nodes import qos
from intent_recognition.nodes.activation_parameters import Taught
from intent_recognition.nodes.conversions import stamp_ns, trajectory_arrays
from intent_recognition.nodes.diagnostics import Diagnostics, RejectionError
from intent_recognition.nodes.hand_input import HandInput, no_description
from intent_recognition.nodes.object_transfer import FRESH_S, TRANSFER
from intent_recognition.nodes.parameters import declare
from intent_recognition.nodes.planning_scene import BOTH, READ, PlanningSceneLink
from intent_recognition.nodes.runtime import now_ns
from intent_recognition.promp import TaskLibrary
from intent_recognition.share import share_path
from intent_recognition.transfer import EXCHANGES
from intent_recognition.untrusted import load_yaml, read_text

TOPIC = "intent/human_trajectory"
_METRES = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
_FRESH_NS = round(FRESH_S * 1e9)
_AGREE_NS = 50_000_000
"""Offset up to which two clocks agree [ns]: several steps of a simulation's."""
_STATES = {state.value for state in EXCHANGES}


class ClearanceInput:
    """Makes `clearance` from the arm's URDF; None before the URDF has come, or if switched off."""

    def __init__(self, node: Node, diagnostics: Diagnostics) -> None:
        self._node, self._diagnostics = node, diagnostics
        values = declare(node, "clearance")
        self._distance_m = values["clearance"]
        self._boxes = parse_boxes(values["boxes"])
        self._largest_bend = values["largest_bend"]
        self._times_s = values["replan_budget"], values["clear_wait"]
        use = values["planning_scene"]
        asked = "boxes" if self._boxes else "a planning scene" if use in (READ, BOTH) else ""
        if asked and not self._distance_m:
            cure = f"Try 0.02, or do without {asked}."
            raise ArgumentError.about("clearance", f"above 0 m with {asked}", 0.0, cure)
        self._scene = PlanningSceneLink(
            node, diagnostics, use, values["planning_frame"], self._boxes
        )
        self._of_scene: tuple[Box, ...] = ()
        self.clearance: Clearance | None = None
        self._description = ""
        self._taught: Taught | None = None
        self._rejection: RejectionError | None = None

    def update(self, description: str, names: tuple[str, ...], taught: Taught) -> bool:
        """Remake `clearance` if URDF, boxes or tasks have changed; returns whether they have.

        Raises:
            RejectionError: a clearance is wanted, but the URDF is unknown (empty) or unusable.
        """
        if not self._distance_m:
            return False
        if not description:
            raise RejectionError("no_robot_description", no_description("clearance"))
        changed = (description, self._scene.boxes) != (self._description, self._of_scene)
        changed |= taught is not self._taught
        if changed:
            self._description, self._taught, self._rejection = description, taught, None
            self._of_scene = self._scene.boxes
            try:
                self._make(description, names, taught)
            except IntentError as error:
                self._rejection = RejectionError("bad_robot_description", str(error))
        if self._rejection is not None:
            raise self._rejection
        return changed

    def _make(self, description: str, names: tuple[str, ...], taught: Taught) -> None:
        boxes = (*self._boxes, *self._of_scene)
        bodies = Bodies(description, names, boxes, clearance_m=self._distance_m)
        spreads = taught.spreads(Spread.of)
        self.clearance = Clearance(
            bodies, spreads, self._largest_bend, *self._times_s, self._spent_s
        )
        things = ", ".join([*(box.name for box in boxes), "itself"])
        self._node.get_logger().info(
            f"keeps {self._distance_m:g} m clear of {things}: {len(bodies.pairs)} pairs of bodies"
        )

    def _spent_s(self) -> float:
        """Processor time [s]; 0 if simulated time waits for the node, so that plans repeat."""
        return 0.0 if self._diagnostics.answers else time.thread_time()


class PersonInput:
    """Keeps the newest predicted tube of each person's tracked point (`intent/human_trajectory`).

    Attributes:
        people: the predicted people, in the frame of the URDF's root link.
        separation: slows plans near people; None if not requested, or before the arm is known.
        slow_places: slows plans near given places; None under the same conditions.
    """

    def __init__(self, node: Node, hand: HandInput, diagnostics: Diagnostics) -> None:
        self._node, self._hand, self._diagnostics = node, hand, diagnostics
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
        self._metres = 1.0
        self._people: dict[str, PredictedPerson] = {}
        self._clocks: dict[str, ArmClock] = {}
        self.people: tuple[PredictedPerson, ...] = ()
        self.separation: Separation | None = None
        self.slow_places: SlowPlaces | None = None
        self._arm: Arm | None = None

    def know(self, library: TaskLibrary) -> None:
        """Take the unit of `person_dofs` from a model.

        Raises:
            ArgumentError: they are no DOFs of the model, or no lengths.
        """
        units = dict(zip(library.observed_names, library.observed_units, strict=True))
        of_person = {units.get(name, "no such DOF") for name in self._dofs}
        if len(of_person) > 1 or not of_person <= _METRES.keys():
            cure = "`intent inspect MODEL` lists them."
            got = f"{', '.join(self._dofs)} ({', '.join(sorted(of_person))})"
            raise ArgumentError.about("person_dofs", "positions that the model observes", got, cure)
        self._metres = _METRES[of_person.pop()] if of_person else 1.0

    def hear(self, person: str, topic: str = TOPIC) -> None:
        """Subscribe to the predicted trajectory of one more person, if `person_dofs` is set."""
        if self._dofs:
            take = partial(self._take, person)
            self._diagnostics.subscribe(JointTrajectory, topic, take, qos.COMMAND, TOPIC)

    def update(self, names: tuple[str, ...]) -> bool:
        """Remake `separation` and `slow_places` for a new arm; returns whether the arm is new.

        Raises:
            RejectionError: one of them is requested, but the arm is unknown or has other joints.
        """
        if not self._dofs and not len(self._places):
            return False
        arm = self._hand.arm
        if arm is None:
            argument = "person_dofs" if self._dofs else "slow_at"
            raise RejectionError("no_robot_description", no_description(argument))
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
        # the person's last prediction stays in force
        with self._diagnostics.rejecting("bad_human_trajectory", TOPIC):
            times_s, positions, rest = trajectory_arrays(message)
            names = list(message.joint_names)
            if not {*self._dofs} <= {*names} or (len(times_s) and "effort" not in rest):
                expected = f"{', '.join(self._dofs)}, and effort"
                got = f"{', '.join(names)}; {', '.join(rest) or 'positions alone'}"
                raise ArgumentError.about("joint_names", expected, got, "Check the sender.")
            columns = [names.index(name) for name in self._dofs]
            if np.all(times_s == times_s[-1:]):  # the movement is at its end
                times_s, positions = times_s[-1:], positions[-1:]
                rest = {name: values[-1:] for name, values in rest.items()}
            if not len(times_s) or np.any(np.diff(times_s) <= 0.0):
                got = f"{len(times_s)} that do not" if len(times_s) else "none"
                cure = "Check the sender."
                raise ArgumentError.about("points", "times that increase", got, cure)
            mean, std = positions[:, columns], rest["effort"][:, columns]
            if not (np.all(np.isfinite(mean)) and np.all(np.isfinite(std))):
                raise ArgumentError.about("points", "finite numbers", "NaN", "Check the sender.")
            times_ns = stamp_ns(message) + np.rint(times_s * 1e9).astype(np.int64)
            if len(times_ns) > 1:  # else the movement may have ended long ago
                times_ns += self._shift_ns(who, int(times_ns[0]))
            # The root of the trace bounds the standard deviation in every direction.
            self._people[who] = PredictedPerson(
                times_ns,
                mean * self._metres + np.array(self._offset),
                np.linalg.norm(std, axis=1) * self._metres,
            )
            self.people = tuple(self._people.values())

    def _shift_ns(self, who: str, begin_ns: int) -> int:
        """How far the clock of a person's tracker is behind [ns], by where a prediction begins."""
        clock, arrival_ns = self._clocks.setdefault(who, ArmClock()), now_ns(self._node)
        clock.hear(arrival_ns, begin_ns)
        behind_ns = max((clock.offset_ns for clock in self._clocks.values()), key=abs)
        self._diagnostics.value("people behind", f"{behind_ns * 1e-9:.3f} s")
        if abs(clock.offset_ns) <= _AGREE_NS:
            return 0
        age_ns = self._node.get_parameter("max_joint_state_age").value * 1e9
        return clock.measured_ns(arrival_ns, begin_ns, age_ns) - begin_ns


def make_correction(
    detector: DeviationDetector | None, names: tuple[str, ...], taught: Taught
) -> Correction | None:
    """How the arm yields to a person; None without a detector.

    Raises:
        ArgumentError: the detector is of another number of joints.
    """
    if detector is None:
        return None
    if detector.explained.size != len(names):
        expected = f"errors of {len(names)} joints"
        cure = "Give a file of this arm."
        raise ArgumentError.about("correction", expected, f"{detector.explained.size}", cure)
    return Correction(detector, taught.spreads(Spread.given_person))


def load_detector(name: str) -> DeviationDetector:
    """Load a detector from a YAML file, or a shipped one by its name."""
    path = Path(name)
    if path.suffix != ".yaml":
        path = share_path(f"config/deviation/{name}.yaml")
    try:
        found = load_yaml(read_text(path))
        coefficients = np.array([found[key] for key in ("constant", "velocity", "acceleration")])
        explained = np.array(found["explained"], dtype=np.float64)
        numbers = [float(found[key]) for key in ("sustained", "false_alarm_rate", "least")]
        fits = explained.ndim == 1 and coefficients.shape == (3, explained.size)
        values = [*coefficients.ravel(), *explained.ravel(), *numbers]
        if not fits or not np.all(np.isfinite(values)) or min(numbers) < 0.0:
            raise ValueError("numbers that do not fit")
    except (OSError, KeyError, TypeError, ValueError) as error:
        expected = (
            "constant, velocity, acceleration, explained, one number a joint each, and sustained,"
            " false_alarm_rate, least"
        )
        raise ArgumentError.about(str(path), expected, error, "Correct the file.") from None
    return DeviationDetector(coefficients.astype(np.float64), explained, *numbers)


class TransferInput:
    """Keeps the transfer states of the last `FRESH_S` seconds.

    The newest state with a stamp before the present counts, so that the order of messages with
    equal stamps does not matter. If all are ahead of the node's clock, the oldest counts.
    """

    def __init__(self, diagnostics: Diagnostics) -> None:
        self._states: deque[tuple[int, bool]] = deque()
        diagnostics.subscribe(JointState, TRANSFER, self._take, qos.STATE)

    def _take(self, message: JointState) -> None:
        at_ns = stamp_ns(message)
        self._states.append((at_ns, message.header.frame_id in _STATES))
        while not 0 <= at_ns - self._states[0][0] <= _FRESH_NS:
            self._states.popleft()

    def exchanging_until_ns(self, now_ns: int) -> int:
        """Time until which an object is known to change hands [ns]; 0 if none does."""
        if not self._states:
            return 0
        past = (state for state in reversed(self._states) if state[0] < now_ns)
        at_ns, exchanges = next(past, self._states[0])
        return at_ns + _FRESH_NS if exchanges else 0
