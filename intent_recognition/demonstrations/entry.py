# SPDX-License-Identifier: Apache-2.0
"""Entry of a DOF file: the degrees of freedom in the messages of one topic."""

import dataclasses

from intent_recognition.demonstrations.paths import STAMPED_ELEMENTS, element_of


@dataclasses.dataclass(frozen=True)
class DofEntry:
    """The degrees of freedom (DOFs) in the messages of one topic.

    Attributes:
        topic: relative topic name, without a leading slash.
        type: full message type, "package/msg/Name".
        fields: paths such as "pose.position.x", "poses[7].position.x" or
            "transforms[wrist].transform.translation.x"; an array element is named by its index,
            a transform by its child frame, a marker by namespace/id.
        joints: joint names of a JointState, in the order of the DOFs; `*` matches any text, such
            as the identifier of a tracked person. An entry has either `fields` or `joints`.
        unit: unit of all DOFs of this entry, such as "m" or "rad".
        quantity: quantity read for each joint: "position", "velocity" or "effort".
        orientation: "quaternion" if the four fields x, y, z, w form a quaternion, whose three DOFs
            are a rotation vector [rad] (`signals.orientation`); else empty.
        reference: unit quaternion (4,) xyzw to which the rotation vector is relative; empty until
            `settle_orientations` sets it to the mean of the demonstrations.
        of: for measured velocities, the names of the observed DOFs they belong to; else empty.
        std: standard deviation of each velocity [unit], used if a message has no covariance.
        link: for a controlled hand, the robot link whose pose the entry holds; if the topic was
            not recorded, the pose is computed from `joint_states`.
        robot: path of the URDF, relative to the shipped `config` or absolute, that gives the pose
            of a controlled hand and joint limits if the recording has no `robot_description`.
        context: whether the entry describes the scene instead of the human, such as the place of a
            box, known before the human moves or learned during the movement.
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
        """One name per DOF: the joint (with its quantity, if not position) or topic and field."""
        if self.joints:
            suffix = "" if self.quantity == "position" else f".{self.quantity}"
            return tuple(joint + suffix for joint in self.joints)
        if self.orientation:
            place = self.fields[0].rpartition(".")[0]
            return tuple(f"{self.topic}.{place}.r{axis}" for axis in "xyz")
        return self.message_names

    @property
    def message_names(self) -> tuple[str, ...]:
        """One name per number in a message: as `names`, but four names for a quaternion."""
        if self.joints:
            return self.names
        return tuple(f"{self.topic}.{field}" for field in self.fields)

    @property
    def stream(self) -> str:
        """Identifier shared by entries with common stamps: topic and, if stamped, its elements."""
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
