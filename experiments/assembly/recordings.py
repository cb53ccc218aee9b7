# SPDX-License-Identifier: Apache-2.0
"""The recordings of the box assembly: three session bags of 40 demonstrations, wrist to wrist."""

from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from experiments.recording import Content, known_of, recorded_at_ns, session_messages
from sim_bridge.scenarios.assembly import ASSISTANT, MARGIN_S, SESSIONS, WORKER, plan_session

COARSE_STEPS = 2.0**-12, 2.0**-9
"""Resolution of positions, 0.24 mm [m], and of quaternions' components: far below the noise, and
files of two bodies stay small."""


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
    marks = [(i.onset_s - MARGIN_S, i.task) for i in plan.interactions]
    marks += [(i.end_s + MARGIN_S, "") for i in plan.interactions]
    bodies = {f"mocap/{WORKER}/pose": plan.worker, f"mocap/{ASSISTANT}/pose": plan.assistant}
    return metadata, session_messages(recorded_at_ns(60 * order.index), marks, bodies, COARSE_STEPS)
