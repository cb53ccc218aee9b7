# SPDX-License-Identifier: Apache-2.0
"""The recordings of the box assembly: three session bags of 40 demonstrations, wrist to wrist."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from experiments.recording import (
    POSE_TYPE,
    SAMPLE_NS,
    Content,
    Message,
    known_of,
    pose_fields,
    recorded_at_ns,
    to_counts,
)
from intent_recognition.demonstrations import MARKER_TOPIC, MARKER_TYPE
from sim_bridge.scenarios.assembly import (
    ASSISTANT,
    MARGIN_S,
    SESSIONS,
    WORKER,
    AssemblySession,
    plan_session,
)

COARSE_POSITION_STEP_M = 2.0**-12
"""Resolution of positions, 0.24 mm [m]: two bodies make small files, far below the noise."""
COARSE_QUATERNION_STEP = 2.0**-9
"""Resolution of quaternions' components, for the same reason."""


@dataclass(frozen=True)
class AssemblyOrder:
    """One session to record."""

    seed: int
    index: int

    @property
    def folder(self) -> PurePosixPath:
        """Where the bag goes, below the folder for all bags."""
        return PurePosixPath("assembly", f"session_{self.index:02d}")


def orders(seed: int) -> list[AssemblyOrder]:
    """All sessions."""
    return [AssemblyOrder(seed, index) for index in range(SESSIONS)]


def content(order: AssemblyOrder, _: Path) -> Content:
    """Simulate one recording: its metadata and its messages."""
    plan = plan_session(order.seed, order.index)
    metadata = known_of(order.seed, order.index) | {"bodies": f"{WORKER} {ASSISTANT}"}
    return metadata, messages(plan, recorded_at_ns(60 * order.index))


def messages(plan: AssemblySession, start_ns: int) -> Iterator[Message]:
    """Yield (topic, type, stamp in ns, fields), in order of time."""
    marks = [(i.onset_s - MARGIN_S, i.task) for i in plan.interactions]
    marks += [(i.end_s + MARGIN_S, "") for i in plan.interactions]
    waiting = sorted((start_ns + round(at_s * 1e9), label) for at_s, label in marks)
    bodies = [
        (
            f"mocap/{body}/pose",
            samples.visible,
            to_counts(samples.positions_m, COARSE_POSITION_STEP_M),
            to_counts(samples.orientations, COARSE_QUATERNION_STEP),
        )
        for body, samples in ((WORKER, plan.worker), (ASSISTANT, plan.assistant))
    ]
    for k in range(len(plan.worker.times_s)):
        stamp = start_ns + k * SAMPLE_NS
        while waiting and waiting[0][0] <= stamp:
            at_ns, label = waiting.pop(0)
            yield MARKER_TOPIC, MARKER_TYPE, at_ns, {"data": label}
        for topic, visible, positions, turns in bodies:
            if visible[k]:
                yield topic, POSE_TYPE, stamp, pose_fields(stamp, positions[k], turns[k])
