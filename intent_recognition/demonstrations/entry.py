# SPDX-License-Identifier: Apache-2.0
"""One entry of a DOF file: the degrees of freedom in the messages of one topic."""

import dataclasses

from intent_recognition.demonstrations.paths import STAMPED_ELEMENTS, element_of


@dataclasses.dataclass(frozen=True)
class DofEntry:
    """The degrees of freedom (DOFs) in the messages of one topic.

    Attributes:
        topic: relative topic name, without a leading slash.
        type: full message type, "package/msg/Name".
        fields: paths such as "pose.position.x", "poses[7].position.x" or
            "transforms[wrist].transform.translation.x"; an element of an array is given by its
            number, a transform by its child frame, a marker by namespace/id.
        joints: joint names of a JointState, in the order of the DOFs; `*` stands for any text, such
            as the identifier of a tracked person. An entry has either `fields` or `joints`.
        unit: of all DOFs of this entry, such as "m" or "rad".
        quantity: what is read of each joint: "position", "velocity" or "effort".
        orientation: "quaternion" where the four fields x, y, z, w are one; its three DOFs are a
            rotation vector [rad] (`signals.orientation`). Else empty.
        reference: unit quaternion (4,) xyzw from which that leads to the orientation; empty where
            it is still to be the mean of the demonstrations (`settle_orientations`).
        of: for measured velocities, the names of the observed DOFs they belong to; else empty.
        std: standard deviation of each velocity [unit], used where a message has no covariance.
        link: for a controlled hand, the link of the robot whose pose this is; where the topic was
            not recorded it is computed from `joint_states`.
        robot: path of the URDF that a controlled hand is computed with, and joints are compared
            with, where the recording has no `robot_description`; relative to the shipped `config`,
            or absolute.
        context: whether it is of the scene instead of the human: what is known before he moves, or
            learned on the way, such as where a box stands.
    """

    topic: str
    type: str
    fields: tuple[str, ...] = ()
    joints: tuple[str, ...] = ()
    unit: str = ""
    quantity: str = "position"
    orientation: str = ""
    reference: tuple[float, ...] = ()
    of: tuple[str, ...] = ()
    std: float | None = None
    link: str = ""
    robot: str = ""
    context: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        """One name per DOF, of the joint (and of its quantity, if not position) or the field."""
        if self.joints:
            suffix = "" if self.quantity == "position" else f".{self.quantity}"
            return tuple(joint + suffix for joint in self.joints)
        if self.orientation:
            place = self.fields[0].rpartition(".")[0]
            return tuple(f"{self.topic}.{place}.r{axis}" for axis in "xyz")
        return self.message_names

    @property
    def message_names(self) -> tuple[str, ...]:
        """One name per number in messages: those of the DOFs, but for the four of a quaternion."""
        if self.joints:
            return self.names
        return tuple(f"{self.topic}.{field}" for field in self.fields)

    @property
    def stream(self) -> str:
        """What shares the stamps of this entry: the topic, or stamped elements of its arrays."""
        if self.type not in STAMPED_ELEMENTS:
            return self.topic
        return f"{self.topic} {sorted(set(map(str, map(element_of, self.fields))))}"

    def to_dict(self) -> dict[str, object]:
        """The entry as written in a DOF file."""
        content: dict[str, object] = {"topic": f"/{self.topic}", "type": self.type}
        for key in dataclasses.fields(self):
            value = getattr(self, key.name)
            if key.name not in ("topic", "type", "unit") and value != key.default:
                content[key.name] = list(value) if isinstance(value, tuple) else value
        return content | {"unit": self.unit}
