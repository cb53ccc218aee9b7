# SPDX-License-Identifier: Apache-2.0
"""Raw tracker poses to world-frame poses: outliers and bad stamps out, covariance attached.

The node `mocap_ingest`, the training and the replay of bags all pass a raw pose through
`ingest_pose`, so that what is learned is what is seen online.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from intent_recognition.errors import ArgumentError, ShapeError, describe
from intent_recognition.tracking.transforms import (
    RigidTransform,
    multiply_quaternions,
    normalise_quaternion,
)
from intent_recognition.tracking.velocity import Velocity, fit_velocity

NOT_FINITE = "not_finite"
ZERO_STAMP = "zero_stamp"
STAMP_NOT_INCREASING = "stamp_not_increasing"
JUMP = "jump"
UNKNOWN_FRAME = "unknown_frame"
REASONS = (NOT_FINITE, ZERO_STAMP, STAMP_NOT_INCREASING, JUMP, UNKNOWN_FRAME)

NOISE_MARGIN = 6.0
"""Standard deviations of the tracker by which two samples may differ at any rate."""
WINDOW_SAMPLES = 20
"""Samples the velocity is fitted to, roughly; never more than twice as many."""
FARTHEST_M = 1e5
"""Positions beyond this are as unusable as infinite ones."""
IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])
IDENTITY.setflags(write=False)


@dataclass(frozen=True)
class IngestSettings:
    """How raw poses become world-frame poses.

    Attributes:
        world_frame: name of the world frame; poses in it need no extrinsics.
        extrinsics: pose of each tracker frame in the world, as (xyz (3,) [m], quaternion (4,)
            xyzw); poses in a frame that is neither here nor the world are rejected.
        max_speed_m_s: a step that implies a higher speed is a jump.
        max_gap_s: after so long without an accepted sample any position is accepted.
        position_std_m: tracker noise, one number or one per axis (3,) of the tracker's frame.
        reanchor_after: this many jumps on end, consistent with one another, are a new position.
        clock_reset_after: this many stamps on end in the past, but increasing among themselves,
            are a clock that was set back.
        velocity_window_s: the velocity is fitted over the accepted samples of this last time.

    Raises:
        ArgumentError: a number is not positive and finite, or an extrinsic is no rigid transform.
    """

    world_frame: str = "world"
    extrinsics: Mapping[str, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)
    max_speed_m_s: float = 6.0
    max_gap_s: float = 0.5
    position_std_m: float | np.ndarray = 0.002
    reanchor_after: int = 5
    clock_reset_after: int = 100
    velocity_window_s: float = 0.1

    def __post_init__(self):
        for name in ("max_speed_m_s", "max_gap_s", "velocity_window_s", "position_std_m"):
            value = np.asarray(getattr(self, name), dtype=np.float64)
            if not (np.all(np.isfinite(value)) and np.all(value > 0.0)):
                raise ArgumentError(
                    describe(name, "a finite number above zero", value.tolist(), "Correct it.")
                )
        for name in ("reanchor_after", "clock_reset_after"):
            if getattr(self, name) < 1:
                raise ArgumentError(describe(name, "at least 1", getattr(self, name), "Raise it."))
        std_m = np.asarray(self.position_std_m, dtype=np.float64)
        if std_m.shape not in ((), (3,)):
            raise ArgumentError(
                describe("position_std_m", "one number or three", std_m.shape, "Give one per axis.")
            )
        frames = {frame_name(self.world_frame): RigidTransform.identity()}
        for frame, (translation, quaternion) in self.extrinsics.items():
            frames[frame_name(frame)] = RigidTransform(translation, quaternion)
        variances = np.broadcast_to(std_m**2, (3,))
        covariances = {}
        for frame, transform in frames.items():
            covariance = (transform.rotation * variances) @ transform.rotation.T
            covariance = 0.5 * (covariance + covariance.T)
            covariance.setflags(write=False)
            covariances[frame] = covariance
        object.__setattr__(self, "_frames", frames)
        object.__setattr__(self, "_covariances", covariances)
        object.__setattr__(self, "_margin_m", NOISE_MARGIN * float(np.max(std_m)))


@dataclass(frozen=True)
class TrackedPose:
    """An accepted pose in the world frame.

    Attributes:
        stamp_ns: time of measurement.
        position: (3,) [m].
        orientation: unit quaternion (4,) xyzw.
        orientation_measured: False if the tracker gave none (an all-zero quaternion);
            `orientation` is then the identity.
        position_covariance: of the measurement, (3, 3) [m^2], world axes.
        velocity: (3,) [m/s], world axes, or None with fewer than three recent samples. Fitted
            to the same positions: for onset and display, never evidence of its own.
        velocity_covariance: (3, 3) [m^2/s^2], or None with the velocity.
        reanchored: True if the track was given up and begun anew with this sample.
    """

    stamp_ns: int
    position: np.ndarray
    orientation: np.ndarray
    orientation_measured: bool
    position_covariance: np.ndarray
    velocity: np.ndarray | None = None
    velocity_covariance: np.ndarray | None = None
    reanchored: bool = False


@dataclass(frozen=True)
class Rejected:
    """A dropped observation: `reason` is one of REASONS, `detail` a sentence for the log."""

    reason: str
    detail: str


@dataclass(frozen=True)
class IngestState:
    """What must be remembered of one body between samples; never modified.

    Attributes:
        recent: accepted (stamp_ns, position (3,)) of the velocity window, thinned out at high
            rates, oldest first; the last is the last accepted one.
        jump: (stamp_ns, position) of the last rejected jump of the running streak, or None.
        jumps: length of that streak.
        late_ns: stamp of the last sample of the running streak of late ones, or None.
        late: length of that streak.
    """

    recent: tuple[tuple[int, np.ndarray], ...] = ()
    jump: tuple[int, np.ndarray] | None = None
    jumps: int = 0
    late_ns: int | None = None
    late: int = 0

    @classmethod
    def initial(cls) -> "IngestState":
        """The state before the first sample."""
        return cls()


def ingest_pose(
    settings: IngestSettings,
    state: IngestState,
    stamp_ns: int,
    position: np.ndarray,
    orientation: np.ndarray,
    frame_id: str,
) -> tuple[IngestState, TrackedPose | Rejected]:
    """Check one raw pose of one body and put it into the world frame.

    Checked in this order: NaN or infinity anywhere (`not_finite`), stamp zero or negative
    (`zero_stamp`), frame without extrinsics (`unknown_frame`), stamp not after the last accepted
    one (`stamp_not_increasing`), speed (`jump`). A rejected sample never changes the track.

    The speed gate compares with the last accepted sample: a step may be as long as
    `max_speed_m_s` times the time since then, plus six standard deviations of the tracker. It
    widens while nothing is accepted, and after `max_gap_s` any position is accepted, so a body
    that reappears elsewhere after an occlusion is found again. `reanchor_after` jumps on end, each
    within the gate of the one before it, mean that the track was wrong and not they: the last of
    them is accepted and a new track begins there (an outlier as the very first sample thus costs
    a few samples, not the session). A clock set back is followed after `clock_reset_after` late
    samples in the same way.

    Args:
        settings: frames, gate and noise.
        state: what the last call for this body returned, or `IngestState.initial()`.
        stamp_ns: time of measurement in integer nanoseconds.
        position: (3,) [m] in `frame_id`.
        orientation: (4,) xyzw in `frame_id`, need not be normalised; all zero means not measured.
        frame_id: frame of the tracker; a leading slash is ignored.

    Returns:
        The next state, and the pose in the world frame or why it was rejected.

    Raises:
        ShapeError: position or orientation has the wrong length (a fault of the caller).
    """
    position = np.asarray(position, dtype=np.float64)
    orientation = np.asarray(orientation, dtype=np.float64)
    if position.shape != (3,) or orientation.shape != (4,):
        got = f"{position.shape} and {orientation.shape}"
        raise ShapeError(
            describe("position, orientation", "shapes (3,) and (4,)", got, "Pass one pose.")
        )
    rejected = _check_sample(settings, stamp_ns, position, orientation, frame_id)
    if rejected is not None:
        return state, rejected
    frame = frame_name(frame_id)
    transform = settings._frames[frame]
    world = transform.apply(position)
    world.setflags(write=False)
    sample = (int(stamp_ns), world)
    state, rejected, reanchored = _follow(settings, state, sample)
    if rejected is not None:
        return state, rejected
    unit = normalise_quaternion(orientation)
    turned = IDENTITY if unit is None else multiply_quaternions(transform.quaternion, unit)
    velocity = _velocity(settings, state)
    return state, TrackedPose(
        stamp_ns=sample[0],
        position=world,
        orientation=turned,
        orientation_measured=unit is not None,
        position_covariance=settings._covariances[frame],
        velocity=None if velocity is None else velocity.mean,
        velocity_covariance=None if velocity is None else velocity.covariance,
        reanchored=reanchored,
    )


def frame_name(frame_id: str) -> str:
    """`frame_id` without a leading slash (tf2 knows none)."""
    return frame_id.removeprefix("/")


def _check_sample(settings, stamp_ns, position, orientation, frame_id) -> Rejected | None:
    """Whatever can be said of one sample without knowing the ones before it."""
    numbers = position.tolist()
    finite = all(map(math.isfinite, numbers + orientation.tolist()))
    if not finite or max(map(abs, numbers)) > FARTHEST_M:
        return Rejected(
            NOT_FINITE, f"position {position.tolist()}, orientation {orientation.tolist()}"
        )
    if stamp_ns <= 0:
        return Rejected(ZERO_STAMP, f"stamp {stamp_ns} ns; the tracker must stamp its poses")
    if frame_name(frame_id) not in settings._frames:
        known = ", ".join(settings._frames)
        return Rejected(UNKNOWN_FRAME, f"frame '{frame_id}' has no extrinsics; known: {known}")
    return None


def _follow(settings, state, sample) -> tuple[IngestState, Rejected | None, bool]:
    """Extend the track by a sample; returns state, why not, and whether it began anew."""
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
        state = replace(state, late_ns=stamp_ns, late=late)
        return state, Rejected(STAMP_NOT_INCREASING, detail), False
    gap_s = (stamp_ns - last_ns) * 1e-9
    if gap_s > settings.max_gap_s:
        return IngestState(recent=(sample,)), None, state.jumps > 0
    if _within_gate(settings, state.recent[-1], sample):
        return IngestState(recent=_slide(settings, state.recent, sample)), None, False
    return _follow_jump(settings, state, sample)


def _slide(settings, recent, sample):
    """Move the velocity window on; at high rates it keeps about twenty samples and the newest."""
    window_ns = settings.velocity_window_s * 1e9
    if len(recent) > 1 and sample[0] - recent[-2][0] < window_ns / WINDOW_SAMPLES:
        recent = recent[:-1]
    oldest_ns = sample[0] - window_ns
    return (*(s for s in recent if s[0] >= oldest_ns), sample)


def _follow_jump(settings, state, sample) -> tuple[IngestState, Rejected | None, bool]:
    """Count a jump; enough of them, consistent with one another, are the new track."""
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
    state = replace(state, jump=sample, jumps=jumps, late_ns=None, late=0)
    return state, Rejected(JUMP, detail), False


def _within_gate(settings, earlier, later) -> bool:
    """Whether a person could have moved from one sample to the other."""
    reach_m = settings.max_speed_m_s * (later[0] - earlier[0]) * 1e-9 + settings._margin_m
    return math.dist(later[1], earlier[1]) <= reach_m


def _velocity(settings, state) -> Velocity | None:
    if len(state.recent) < 3:
        return None
    stamps_ns = np.array([stamp_ns for stamp_ns, _ in state.recent], dtype=np.int64)
    positions = np.array([position for _, position in state.recent])
    variance = (settings._margin_m / NOISE_MARGIN) ** 2
    return fit_velocity(stamps_ns, positions, variance)
