# SPDX-License-Identifier: Apache-2.0
"""The arm as bodies among boxes: which come close along a motion, and how to separate them.

Distances are computed by coal, through pinocchio; both are only imported for the first `Bodies`.
Meshes are replaced by their convex hulls, which contain them and are faster to measure.
"""

from bisect import bisect_right
from collections.abc import Sequence
from heapq import heappop, heapreplace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError, describe, one_line, optional
from intent_recognition.kinematics.links import ReducedModel
from intent_recognition.kinematics.packages import check_meshes, package_shares
from intent_recognition.kinematics.urdf import mimics_of
from intent_recognition.kinematics.urdf_tree import LINK, parse_urdf, read_urdf, separate_names

_WIDEST_RAD = np.pi
"""Largest joint angle of random postures [rad], needed because continuous joints have no limit."""


class Box(NamedTuple):
    """An obstacle in the cell."""

    name: str
    center: tuple[float, ...]  # (3,) [m], in the frame of the URDF's root link
    size: tuple[float, ...]  # whole edge lengths (3,) [m]
    quaternion: tuple[float, ...] = (0.0, 0.0, 0.0, 1.0)  # x, y, z, w

    @property
    def rotation(self) -> Floats:
        """Axes of the box as columns (3, 3)."""
        return Rotation.from_quat(self.quaternion).as_matrix()


def parse_boxes(texts: Sequence[str]) -> tuple[Box, ...]:
    """Read boxes from strings 'name x y z length width height [qx qy qz qw]'.

    Raises:
        ArgumentError: a string is no box, or two boxes have the same name.
    """
    boxes = tuple(_parse_box(text) for text in texts if text)
    names = [box.name for box in boxes]
    if len(set(names)) != len(names):
        raise ArgumentError.about("boxes", "different names", names, "Rename one.")
    return boxes


def _parse_box(text: str) -> Box:
    name, *words = text.split() or [""]
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        numbers = []
    turned = numbers[6:] or [0.0, 0.0, 0.0, 1.0]
    if (
        len(numbers) not in (6, 10)
        or not np.all(np.isfinite(numbers))
        or min(numbers[3:6]) <= 0.0
        or abs(np.linalg.norm(turned) - 1.0) > 1e-3
    ):
        expected = "'name x y z length width height [qx qy qz qw]', sizes above 0, unit quaternion"
        raise ArgumentError.about("boxes", expected, text, "In metres.")
    return Box(name, tuple(numbers[:3]), tuple(numbers[3:6]), tuple(turned))


class Contact(NamedTuple):
    """Two bodies that are closer than the clearance."""

    sample: int  # index of the sample of the motion
    pair: int  # index of the pair of bodies
    distance_m: float  # distance between them; negative if they overlap


class Bodies:
    """The links of an arm, and boxes around it.

    Joint vectors have one value for each of `joint_names`; other joints stay at zero. Pairs that
    cannot separate are left out: those on one rigid body, joined by one joint, or closer than the
    clearance in each of 100 random postures (such as the first link and the table below it). An
    instance has internal buffers, so only one thread at a time may use it.

    Args:
        source: path or text of a URDF, whose mesh files are found on this machine.
        joint_names: the joints that move, in the order of joint vectors.
        boxes: boxes in the frame of the URDF's root link.
        clearance_m: distance to keep between bodies, above 0.

    Attributes:
        pairs: names of the two bodies of each pair; a link of the arm comes first.

    Raises:
        ArgumentError: the source is no URDF, a joint is unknown, a mesh is missing, or the
            clearance is not above 0.
    """

    def __init__(
        self,
        source: str | Path,
        joint_names: Sequence[str],
        boxes: Sequence[Box] = (),
        *,
        clearance_m: float,
    ) -> None:
        if not clearance_m > 0.0:
            raise ArgumentError.about("clearance", "above 0 m", clearance_m, "Try 0.02.")
        self._pin = pin = optional("pinocchio")
        self._coal = optional("coal")
        self.clearance_m, self.boxes = float(clearance_m), tuple(boxes)
        self._read(read_urdf(source), tuple(joint_names))
        self._add_boxes()
        self._data = self._model.model.createData()
        self._measure_sizes()
        self._choose_pairs()
        self._work = pin.GeometryData(self._geometry)
        self._leave_out_always_near()

    # Distances

    def contacts(
        self, positions: ArrayLike, travel: ArrayLike | None = None, *, first_only: bool = False
    ) -> list[Contact]:
        """Pairs that are closer than the clearance along a motion (T, n), in order of samples.

        No contact at a sample is missed: a pair is measured again at the first sample at which it
        can have come within the clearance (conservative advancement). If no point moves by more
        than twice the clearance between samples (`steps`), no bodies touch in between either.
        `travel` bounds how far joints turn between samples, (T - 1, n); by default, it is the
        difference of the samples.
        """
        q = np.asarray(positions, dtype=np.float64)
        moved = np.abs(np.diff(q, axis=0)) if travel is None else np.asarray(travel, np.float64)
        way = np.zeros((len(self.pairs), len(q)))
        np.cumsum(self._reach.T @ moved.T, axis=1, out=way[:, 1:])
        ways = way.tolist()
        due = [(0, pair) for pair in range(len(ways))]
        placed, found = -1, []
        while due:
            sample, pair = due[0]
            if sample != placed:
                self._place(q[sample])
                placed = sample
            distance, free = self._distance(pair), sample + 1
            if distance < self.clearance_m:
                found.append(Contact(sample, pair, distance))
                if first_only:
                    return found
            else:
                reached = ways[pair][sample] + distance - self.clearance_m
                free = max(bisect_right(ways[pair], reached, sample), free)
            if free < len(q):
                heapreplace(due, (free, pair))
            else:
                heappop(due)
        return found

    def steps(self, travel: Floats) -> int:
        """Number of parts per interval with which `contacts` misses nothing between samples.

        In each interval, joints turn by at most `travel` (T, n) [rad].
        """
        largest = float((travel @ self._reach).max(initial=0.0))
        return max(int(np.ceil(largest / (2.0 * self.clearance_m))), 1)

    def distance_m(self, q: ArrayLike, pair: int) -> float:
        """Distance of a pair at a posture (n,); negative if the bodies overlap."""
        self._place(np.asarray(q, dtype=np.float64))
        return self._distance(pair)

    # Parting

    def gap(self, q: Floats, pair: int) -> tuple[float, Floats]:
        """Distance of a pair at a posture (n,), and its gradient by the joints (n,)."""
        self._place(q)
        first, second = self._ends(pair)
        objects, transform = self._geometry.geometryObjects, self._coal.Transform3s
        result = self._coal.DistanceResult()
        placed = [self._work.oMg[first], self._work.oMg[second]]
        poses = [transform(one.rotation, one.translation) for one in placed]
        one, other = objects[first].geometry, objects[second].geometry
        distance = self._coal.distance(one, poses[0], other, poses[1], self._request, result)
        self._pin.computeJointJacobians(self._model.model, self._data)
        normal = result.normal
        gradient = self._speed(second, result.getNearestPoint2(), normal)
        gradient -= self._speed(first, result.getNearestPoint1(), normal)
        return float(distance), gradient @ self._model.drive

    def _speed(self, body: int, point: Floats, direction: Floats) -> Floats:
        """Derivative of a body point's position along a direction by the configuration, (nv,)."""
        model, joint = self._model.model, self._geometry.geometryObjects[body].parentJoint
        if joint == 0:
            return np.zeros(model.nv)
        at = self._pin.SE3(np.eye(3), self._data.oMi[joint].actInv(point))
        frame = self._pin.LOCAL_WORLD_ALIGNED
        J = self._pin.getFrameJacobian(model, self._data, joint, at, frame)
        return np.asarray(direction @ J[:3], dtype=np.float64)

    # Set-up

    def _read(self, text: str, names: tuple[str, ...]) -> None:
        pin, packages = self._pin, package_shares()
        root = parse_urdf(text)
        mimics = mimics_of(root.findall("joint"))
        check_meshes(root.iterfind("link/collision/geometry/mesh"))
        text = separate_names(root)
        try:
            full = pin.buildModelFromXML(text)
            shapes = pin.buildGeomFromUrdfString(
                full, text, pin.GeometryType.COLLISION, None, packages
            )
        except Exception as error:  # urdfdom and assimp raise plain C++ exceptions
            cure = "Check it with check_urdf, and that its meshes are where it says."
            wrong = describe("robot", "a URDF with shapes", one_line(error), cure)
            raise ArgumentError(wrong) from error
        missing = [name for name in names if name not in set(full.names)]
        if missing or not names:
            known = ", ".join(list(full.names)[1:])
            cure = "Describe the arm that is commanded."
            raise ArgumentError.about("robot", f"the joints {names}", known, cure)
        self._model = ReducedModel.of(pin, full, names, mimics, shapes)
        self._geometry = self._model.geometry
        for shape in self._geometry.geometryObjects:
            if isinstance(shape.geometry, self._coal.BVHModelBase):
                shape.geometry.buildConvexHull(True, "Qt")
                shape.geometry = shape.geometry.convex
        frames = self._model.model.frames
        self._names = [
            frames[shape.parentFrame].name.removeprefix(LINK)
            for shape in self._geometry.geometryObjects
        ]
        self._n_links = len(self._names)
        self._request = self._coal.DistanceRequest()

    def _add_boxes(self) -> None:
        pin = self._pin
        for box in self.boxes:
            pose = pin.SE3(box.rotation, np.array(box.center))
            shape = pin.GeometryObject(f"box {box.name}", 0, 0, pose, self._coal.Box(*box.size))
            self._geometry.addGeometryObject(shape)
            self._names.append(box.name)

    def _measure_sizes(self) -> None:
        """Bound how far a body's points move per unit of each joint's motion, (bodies, joints)."""
        model = self._model.model
        shapes = self._geometry.geometryObjects
        self._far = np.zeros((len(shapes), model.nv))
        for k, shape in enumerate(shapes):
            geometry, joint = shape.geometry, shape.parentJoint
            geometry.computeLocalAABB()
            at = shape.placement.act(geometry.aabb_center)
            radius = float(np.linalg.norm(at)) + float(geometry.aabb_radius)
            while joint:
                column = model.joints[joint].idx_v
                shifts = model.joints[joint].shortname().startswith("JointModelP")
                self._far[k, column] = 1.0 if shifts else radius
                radius += float(np.linalg.norm(model.jointPlacements[joint].translation))
                if shifts:
                    ends = model.lowerPositionLimit[column], model.upperPositionLimit[column]
                    radius += float(np.abs(ends).max())
                joint = model.parents[joint]

    def _choose_pairs(self) -> None:
        """Take all pairs but those of bodies on one joint, or on a joint and the next."""
        shapes, parents = self._geometry.geometryObjects, self._model.model.parents
        for i in range(self._n_links):
            for j in range(i + 1, len(shapes)):
                a, b = shapes[i].parentJoint, shapes[j].parentJoint
                joined = j < self._n_links and (parents[a] == b or parents[b] == a)
                if a != b and not joined:
                    self._geometry.addCollisionPair(self._pin.CollisionPair(i, j))

    def _leave_out_always_near(self) -> None:
        model = self._model.model
        low = np.maximum(model.lowerPositionLimit, -_WIDEST_RAD)
        high = np.minimum(model.upperPositionLimit, _WIDEST_RAD)
        near = list(range(len(self._geometry.collisionPairs)))
        for values in np.random.default_rng(0).uniform(low, high, (100, model.nq)):
            self._pin.updateGeometryPlacements(
                model, self._data, self._geometry, self._work, values
            )
            near = [pair for pair in near if self._distance(pair) < self.clearance_m]
        for pair in [self._geometry.collisionPairs[k] for k in near]:
            self._geometry.removeCollisionPair(pair)
        self._work = self._pin.GeometryData(self._geometry)
        ends = [self._ends(k) for k in range(len(self._geometry.collisionPairs))]
        self.pairs = tuple((self._names[i], self._names[j]) for i, j in ends)
        drive = np.abs(self._model.drive)
        supports = self._far > 0.0
        self._reach = np.zeros((drive.shape[1], len(ends)))
        for k, (i, j) in enumerate(ends):
            own, others = self._far[i] * ~supports[j], self._far[j] * ~supports[i]
            self._reach[:, k] = (own + others) @ drive

    # Inside

    def _ends(self, pair: int) -> tuple[int, int]:
        ends = self._geometry.collisionPairs[pair]
        return ends.first, ends.second

    def _place(self, q: Floats) -> None:
        model = self._model
        self._pin.updateGeometryPlacements(
            model.model, self._data, self._geometry, self._work, model.values(q)
        )

    def _distance(self, pair: int) -> float:
        return float(self._pin.computeDistance(self._geometry, self._work, pair).min_distance)
