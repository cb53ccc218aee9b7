# SPDX-License-Identifier: Apache-2.0
"""Check raw tracker poses, transform them to the world frame, and add covariance and velocity.

The node `mocap_ingest`, training and the replay of bags all use `ingest_pose`, so that models are
learned from the same poses that are observed online. `ingest_poses` processes a whole recording.
"""

import math
from collections import Counter, deque
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from intent_recognition.array_types import Floats, Integers, frozen
from intent_recognition.bags import PoseColumns
from intent_recognition.tracking.settings import IngestSettings, frame_name
from intent_recognition.tracking.transforms import multiply_quaternions, normalise_quaternions

NOT_FINITE = "not_finite"
ZERO_STAMP = "zero_stamp"
STAMP_NOT_INCREASING = "stamp_not_increasing"
JUMP = "jump"

FARTHEST_M = 1e5
"""Distance from which positions are rejected as infinite [m], beyond the range of any tracker."""
NO_ROTATION = frozen((0.0, 0.0, 0.0, 1.0))


Sample = tuple[int, list[float]]
"""Stamp [ns] and position (3,) [m] in the world frame: numbers, which are faster than arrays."""


class Velocity(NamedTuple):
    """A velocity (3,) [m/s] and its covariance (3, 3) [m^2/s^2]."""

    mean: Floats
    covariance: Floats


class TrackedPose(NamedTuple):
    """An accepted pose in the world frame."""

    stamp_ns: int
    position: Floats  # (3,) [m]
    orientation: Floats  # unit quaternion (4,) xyzw
    # False if the tracker gave an all-zero quaternion; `orientation` is then the identity
    orientation_measured: bool
    position_covariance: Floats  # of the measurement, (3, 3) [m^2], world axes
    # in world axes, None with fewer than three recent samples; it is fitted to the positions, so it
    # is not an independent observation
    velocity: Velocity | None = None
    reanchored: bool = False  # whether a new track begins with this sample


class Rejected(NamedTuple):
    """Reason for dropping a pose."""

    reason: str
    detail: str


class IngestState(NamedTuple):
    """Immutable state of one body between samples, initially empty."""

    # accepted samples of the velocity window, oldest first, thinned at high rates; the last one is
    # the last accepted sample
    recent: tuple[Sample, ...] = ()
    # jump, jumps: last of the current consecutive jumps, or None, and their number
    jump: Sample | None = None
    jumps: int = 0
    # late_ns, late: stamp of the last of the current consecutive late samples, and their number
    late_ns: int | None = None
    late: int = 0


class StampWatch:
    """Finds single stamps of one body that are far ahead of the arrival of their pose."""

    def __init__(self) -> None:
        self._ahead_s: deque[float] = deque(maxlen=2)

    def leaps(self, stamp_ns: int, arrival_s: float) -> bool:
        """Whether a stamp, as the first, is over 1 s farther ahead of its arrival than before."""
        ahead_s = stamp_ns * 1e-9 - arrival_s
        leaps = bool(ahead_s - max(self._ahead_s, default=np.inf) > 1.0)
        if stamp_ns > 0:
            self._ahead_s.append(ahead_s)
        return leaps


def ingest_pose(
    settings: IngestSettings,
    state: IngestState,
    stamp_ns: int,
    position: ArrayLike,
    orientation: ArrayLike,
    frame_id: str,
) -> tuple[IngestState, TrackedPose | Rejected]:
    """Check one raw pose of one body and transform it to the world frame.

    The checks are, in this order: NaN or infinity anywhere (`not_finite`), stamp zero or negative
    (`zero_stamp`), frame without extrinsics (`unknown_frame`), stamp not after the last accepted
    one (`stamp_not_increasing`), speed (`jump`). A rejected sample never changes the track.

    The speed gate compares with the last accepted sample: the step must not exceed `max_speed_m_s`
    times the time since then, plus six standard deviations of the tracker. The gate widens while
    nothing is accepted, and after `max_gap_s` any position is accepted, so that a body that
    reappears elsewhere after an occlusion is tracked again. After `reanchor_after` consecutive
    jumps, each within the gate of the previous jump, the track must be wrong: the last jump is
    accepted and begins a new track. A first sample that is an outlier thus costs only a few
    samples. Likewise, a clock that was set back is accepted after `clock_reset_after` late samples.
    A step of more than `margin_m` to exactly zero in the tracker's frame is always a jump.

    Position (3,) [m] and orientation (4,) xyzw are in the frame `frame_id`, whose leading slash is
    ignored. The orientation need not be normalised; all zeros mean that it was not measured.
    `state` is that returned by the last call for this body, or `IngestState()`.

    Returns:
        The next state, and either the pose in the world frame or the reason for rejecting it.
    """
    position = np.asarray(position, dtype=np.float64)
    orientation = np.asarray(orientation, dtype=np.float64)
    rejected = _check_sample(settings, stamp_ns, position, orientation, frame_id)
    if rejected is not None:
        return state, rejected
    frame = frame_name(frame_id)
    transform = settings.frames[frame]
    world = transform.apply(position)
    world.setflags(write=False)
    sample = (int(stamp_ns), world.tolist())
    state, rejected, reanchored = _follow(settings, state, sample, not position.any())
    if rejected is not None:
        return state, rejected
    unit = normalise_quaternions(orientation)
    measured = not math.isnan(unit[0])
    turned = multiply_quaternions(transform.quaternion, unit) if measured else NO_ROTATION
    return state, TrackedPose(
        stamp_ns=sample[0],
        position=world,
        orientation=turned,
        orientation_measured=measured,
        position_covariance=settings.covariances[frame],
        velocity=_velocity(settings, state),
        reanchored=reanchored,
    )


def _check_sample(
    settings: IngestSettings, stamp_ns: int, position: Floats, orientation: Floats, frame_id: str
) -> Rejected | None:
    numbers = position.tolist()
    finite = all(map(math.isfinite, numbers + orientation.tolist()))
    if not finite or max(map(abs, numbers)) > FARTHEST_M:
        return Rejected(
            NOT_FINITE, f"position {position.tolist()}, orientation {orientation.tolist()}"
        )
    if stamp_ns <= 0:
        return Rejected(ZERO_STAMP, f"stamp {stamp_ns} ns; the tracker must stamp its poses")
    if frame_name(frame_id) not in settings.frames:
        known = ", ".join(settings.frames)
        return Rejected("unknown_frame", f"frame '{frame_id}' has no extrinsics; known: {known}")
    return None


def _follow(
    settings: IngestSettings, state: IngestState, sample: Sample, is_zero: bool
) -> tuple[IngestState, Rejected | None, bool]:
    """Extend the track by a sample; a step to one that `is_zero`, as of hidden bodies, is rejected.

    Returns:
        The state, the rejection and whether a new track began.
    """
    if not state.recent:
        return IngestState(recent=(sample,)), None, False
    stamp_ns = sample[0]
    last_ns = state.recent[-1][0]
    if stamp_ns <= last_ns:
        in_order = state.late_ns is not None and stamp_ns > state.late_ns
        late = state.late + 1 if in_order else 1
        if late >= settings.clock_reset_after:
            return IngestState(recent=(sample,)), None, True
        detail = f"stamp {stamp_ns} ns, last accepted {last_ns} ns"
        state = state._replace(late_ns=stamp_ns, late=late)
        return state, Rejected(STAMP_NOT_INCREASING, detail), False
    if is_zero and math.dist(sample[1], state.recent[-1][1]) > settings.margin_m:
        return state, Rejected(JUMP, "to exactly zero, likely hidden from the tracker"), False
    gap_s = (stamp_ns - last_ns) * 1e-9
    if gap_s > settings.max_gap_s:
        return IngestState(recent=(sample,)), None, state.jumps > 0
    if _within_gate(settings, state.recent[-1], sample):
        return IngestState(recent=_slide(settings, state.recent, sample)), None, False
    return _follow_jump(settings, state, sample)


def _slide(
    settings: IngestSettings, recent: tuple[Sample, ...], sample: Sample
) -> tuple[Sample, ...]:
    """The velocity window with a new sample, thinned to 20 earlier samples at high rates."""
    window_ns = settings.velocity_window_s * 1e9
    if len(recent) > 1 and sample[0] - recent[-2][0] < window_ns / 20:
        recent = recent[:-1]
    oldest_ns = sample[0] - window_ns
    while recent and recent[0][0] < oldest_ns:
        recent = recent[1:]
    return (*recent, sample)


def _follow_jump(
    settings: IngestSettings, state: IngestState, sample: Sample
) -> tuple[IngestState, Rejected | None, bool]:
    """Count a jump; enough consecutive jumps that agree with one another begin a new track."""
    consistent = (
        state.jump is not None
        and sample[0] > state.jump[0]
        and _within_gate(settings, state.jump, sample)
    )
    jumps = state.jumps + 1 if consistent else 1
    if jumps >= settings.reanchor_after:
        return IngestState(recent=(sample,)), None, True
    last_ns, last = state.recent[-1]
    gap_s = (sample[0] - last_ns) * 1e-9
    step_m = math.dist(sample[1], last)
    detail = f"{step_m:.3f} m in {gap_s * 1e3:.1f} ms is {step_m / gap_s:.1f} m/s"
    state = state._replace(jump=sample, jumps=jumps, late_ns=None, late=0)
    return state, Rejected(JUMP, detail), False


def _within_gate(settings: IngestSettings, earlier: Sample, later: Sample) -> bool:
    reach_m = settings.max_speed_m_s * (later[0] - earlier[0]) * 1e-9 + settings.margin_m
    return math.dist(later[1], earlier[1]) <= reach_m


def _velocity(settings: IngestSettings, state: IngestState) -> Velocity | None:
    """Slope of the least-squares line through the recent positions, and its covariance.

    It is the velocity in the middle of the samples, so it lags by half their span. Since it is
    computed from the positions, it serves onset detection and display, not as an independent
    observation. None with fewer than three samples.
    """
    if len(state.recent) < 3:
        return None
    stamps_ns = np.array([stamp_ns for stamp_ns, _ in state.recent], dtype=np.int64)
    positions = np.array([position for _, position in state.recent])
    times_s = (stamps_ns - stamps_ns[0]) * 1e-9
    centred_s = times_s - times_s.sum() / times_s.size
    squares_s2 = float(centred_s @ centred_s)
    variance = settings.largest_std_m**2 / squares_s2
    return Velocity(centred_s @ positions / squares_s2, np.eye(3) * variance)


def ingest_poses(
    settings: IngestSettings, raw: PoseColumns
) -> tuple[PoseColumns, Integers, Counter[str]]:
    """Check all samples of one body in order, as `ingest_pose` does one by one.

    All are transformed together, and no velocity is fitted. Positions are in metres.

    Returns:
        The samples in the world frame, with unit quaternions (NaN where none was measured); the
        indices of the accepted samples, int64 (n,); and the number of rejected samples by reason.
    """
    stamps_ns, frames = raw.stamps_ns, raw.frames
    positions, orientations = raw.positions, raw.orientations
    usable = (stamps_ns > 0) & np.all(np.isfinite(orientations), axis=1)
    usable &= np.all(np.abs(positions) <= FARTHEST_M, axis=1)  # False for NaN too
    world, turned = (np.full(given.shape, np.nan) for given in (positions, orientations))
    for index, frame in enumerate(map(frame_name, raw.frame_ids)):
        if (transform := settings.frames.get(frame)) is not None:
            rows = usable & (frames == index)
            world[rows] = transform.apply(positions[rows])
            units = normalise_quaternions(orientations[rows])
            turned[rows] = multiply_quaternions(transform.quaternion, units.T).T
    known = np.isfinite(world[:, 0]).tolist()
    places, zero = world.tolist(), np.all(positions == 0.0, axis=1).tolist()
    accepted, rejected, state = [], Counter[str](), IngestState()
    for row, stamp_ns in enumerate(stamps_ns.tolist()):
        if known[row]:
            state, rejection, _ = _follow(settings, state, (stamp_ns, places[row]), zero[row])
        else:
            pose = positions[row], orientations[row], raw.frame_ids[frames[row]]
            rejection = _check_sample(settings, stamp_ns, *pose)
        if rejection is None:
            accepted.append(row)
        else:
            rejected[rejection.reason] += 1
    columns = replace(raw, positions=world, orientations=turned)
    return columns, np.array(accepted, dtype=np.int64), rejected
