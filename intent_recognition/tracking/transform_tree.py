# SPDX-License-Identifier: Apache-2.0
"""A tree of moving frames with transforms over time, as published on /tf."""

from bisect import bisect_left, insort
from itertools import pairwise
from operator import itemgetter

from scipy.spatial.transform import Rotation, Slerp

from intent_recognition.errors import IntentError
from intent_recognition.tracking.settings import frame_name
from intent_recognition.tracking.transforms import RigidTransform, multiply_quaternions

KEPT_NS = 10_000_000_000
"""Time for which poses are kept [ns], as in tf2's buffer."""


class NoTransformError(IntentError):
    """The pose of a frame in another frame is not known at a time.

    Attributes:
        reason: `unknown_frame`, `not_connected`, `before_transforms` or `after_transforms`.
        may_come: whether a later message may make the pose known.
    """

    def __init__(self, reason: str, text: str):
        super().__init__(text)
        self.reason = reason
        self.may_come = reason != "before_transforms"


class TransformTree:
    """Poses of frames in their parents, interpolated between stamps but not extrapolated.

    A frame has one parent; a pose in another parent replaces all its earlier poses.
    """

    def __init__(self) -> None:
        self._parents: dict[str, str] = {}
        self._fixed: dict[str, RigidTransform] = {}
        self._moving: dict[str, list[tuple[int, RigidTransform]]] = {}

    def add(
        self,
        parent: str,
        child: str,
        stamp_ns: int,
        transform: RigidTransform,
        *,
        fixed: bool = False,
    ) -> None:
        """Add the pose of `child` in `parent` at a time [ns], or for all times if `fixed`.

        A leading slash of a frame's name is ignored.
        """
        parent, child = frame_name(parent), frame_name(child)
        if self._parents.get(child) != parent:
            self._fixed.pop(child, None)
            self._moving.pop(child, None)
            self._parents[child] = parent
        if fixed:
            self._fixed[child] = transform
            return
        track = self._moving.setdefault(child, [])
        if track and stamp_ns < track[-1][0] - KEPT_NS:  # the clock was set back
            track.clear()
        at = bisect_left(track, stamp_ns, key=itemgetter(0))
        if at < len(track) and track[at][0] == stamp_ns:
            track[at] = stamp_ns, transform
            return
        insort(track, (stamp_ns, transform), key=itemgetter(0))
        del track[: bisect_left(track, track[-1][0] - KEPT_NS, key=itemgetter(0))]

    def lookup(self, target: str, source: str, stamp_ns: int) -> RigidTransform:
        """Pose of the frame `source` in the frame `target` at a time.

        Raises:
            NoTransformError: a frame is unknown at that time, or the frames are not connected.
        """
        target, source = frame_name(target), frame_name(source)
        if target == source:
            return RigidTransform.identity()
        above_source, above_target = self._ancestors(source), self._ancestors(target)
        common = next((frame for frame in above_source if frame in above_target), None)
        if common is None:
            known = {*self._parents, *self._parents.values()}
            missing = [frame for frame in (source, target) if frame not in known]
            if missing:
                text = f"frame {missing[0]!r} is not on /tf"
                raise NoTransformError("unknown_frame", text)
            text = f"frames {source!r} and {target!r} are not connected on /tf"
            raise NoTransformError("not_connected", text)
        up = self._chain(above_source, common, stamp_ns)
        return compose(self._chain(above_target, common, stamp_ns).inverse(), up)

    def _ancestors(self, frame: str) -> list[str]:
        found = [frame]
        while frame in self._parents and len(found) <= 100:  # longer chains are loops
            frame = self._parents[frame]
            found.append(frame)
        return found

    def _chain(self, ancestors: list[str], top: str, stamp_ns: int) -> RigidTransform:
        """Pose of the first of `ancestors` in the frame `top`, another of them."""
        pose = RigidTransform.identity()
        for child, _ in pairwise(ancestors[: ancestors.index(top) + 1]):
            pose = compose(self._at(child, stamp_ns), pose)
        return pose

    def _at(self, child: str, stamp_ns: int) -> RigidTransform:
        if child in self._fixed:
            return self._fixed[child]
        track = self._moving[child]
        after = bisect_left(track, stamp_ns, key=itemgetter(0))
        if after == len(track):
            late_s = (stamp_ns - track[-1][0]) * 1e-9
            text = f"frame {child!r} was last published {late_s:.3f} s before the pose"
            raise NoTransformError("after_transforms", text)
        if track[after][0] == stamp_ns:
            return track[after][1]
        if after == 0:
            early_s = (track[0][0] - stamp_ns) * 1e-9
            text = f"frame {child!r} was first published {early_s:.3f} s after the pose"
            raise NoTransformError("before_transforms", text)
        (start_ns, start), (end_ns, end) = track[after - 1 : after + 1]
        return interpolate(start, end, (stamp_ns - start_ns) / (end_ns - start_ns))


def compose(outer: RigidTransform, inner: RigidTransform) -> RigidTransform:
    """Compose transforms: the pose `inner`, given in a frame with the pose `outer`."""
    turned = multiply_quaternions(outer.quaternion, inner.quaternion)
    return RigidTransform(outer.apply(inner.translation), turned)


def interpolate(start: RigidTransform, end: RigidTransform, share: float) -> RigidTransform:
    """Interpolate two poses, linearly in position and by Slerp in orientation (Shoemake 1985)."""
    translation = (1.0 - share) * start.translation + share * end.translation
    turned = Slerp([0.0, 1.0], Rotation.from_quat([start.quaternion, end.quaternion]))(share)
    return RigidTransform(translation, turned.as_quat())
