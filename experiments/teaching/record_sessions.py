# SPDX-License-Identifier: Apache-2.0
"""Record working sessions of the simulated coworker.

Run as `python -m experiments.teaching.record_sessions`.

Session bags of the coworker's wrist with `demonstration` markers, from which the order of the
tasks is learned. No arm is in them. The same seed gives the same bytes.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from experiments.generate import make_room
from experiments.recording import POSE_TOPIC, recorded_at_ns, session_messages, write_recording
from intent_recognition import __version__
from intent_recognition.errors import IntentError
from sim_bridge.coworker import parse_task_list, plan_session

FIRST_SEED = 1001
"""Seed of the first session; the next has the next one."""
SESSIONS, INTERACTIONS = 8, 10
"""Sessions that are recorded, and interactions in each."""


def record_session(folder: Path, seed: int, number: int, interactions: int) -> Path:
    """Write session `number` as a bag in `folder`; return its directory."""
    tasks = parse_task_list("habit", seed, interactions)
    plan = plan_session(seed, tasks)
    path = folder / f"session_{number:02d}"
    metadata = {
        "simulated": "true",
        "generator": "python -m experiments.teaching.record_sessions",
        "generator_version": __version__,
        "seed": str(seed),
        "tasks": " ".join(tasks),
    }
    marks = [(i.onset_s, i.task) for i in plan.interactions]
    marks += [(i.end_s, "") for i in plan.interactions]
    said = session_messages(recorded_at_ns(60 * number), marks, {POSE_TOPIC: plan.samples})
    return write_recording(path, metadata, said)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m experiments.teaching.record_sessions",
        description="Record sessions of the simulated coworker, who works in a habitual order.",
    )
    parser.add_argument("--output", type=Path, default=Path("bags/sessions"), help="folder")
    parser.add_argument("--seed", type=int, default=FIRST_SEED, help="of the first session")
    parser.add_argument("--sessions", type=int, default=SESSIONS, help="how many")
    parser.add_argument("--interactions", type=int, default=INTERACTIONS, help="in each")
    parser.add_argument("--overwrite", action="store_true", help="replace bags of the same name")
    return parser


def main(args: Sequence[str] | None = None) -> int:
    """Run the command; return its exit code."""
    options = _parser().parse_args(args)
    try:
        for number in range(options.sessions):
            make_room(options.output / f"session_{number:02d}", options.overwrite)
            record_session(options.output, options.seed + number, number, options.interactions)
    except IntentError as error:
        sys.stderr.write(f"record_sessions: {error}\n")
        return 1
    sys.stdout.write(f"{options.sessions} sessions in {options.output}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
