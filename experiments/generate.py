# SPDX-License-Identifier: Apache-2.0
"""Make the simulated demonstrations: `python -m experiments.generate --scenario toolbox`.

Each recording depends on the seed and its own place in the list alone and runs in a physics world
of its own: the same seed gives the same bytes, whatever the number of processes.
"""

import argparse
import importlib
import shutil
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path, PurePosixPath
from types import MappingProxyType
from typing import Any

from experiments.recording import write_recording
from intent_recognition.errors import ArgumentError, IntentError, ResourceBusyError

SCENARIOS = MappingProxyType(
    {
        "toolbox": "experiments.teaching.recordings",
        "pointing": "experiments.pointing.recordings",
        "assembly": "experiments.assembly.recordings",
        "pole": "experiments.pole.recordings",
        "pouring": "experiments.pouring.recordings",
        "pours": "experiments.pouring.executed",
    }
)
"""Modules of the scenarios: `orders(seed)` are all recordings, `content(order, bags)` simulates
one; `order.folder` is where its bag goes below `bags`, as toolbox/train/plate_handover_03."""


def generate(
    output: Path,
    seed: int,
    *,
    scenario: str = "toolbox",
    jobs: int = 2,
    overwrite: bool = False,
    progress: Callable[[str, int, int], None] = lambda name, done, total: None,
) -> list[Path]:
    """Make and write all recordings of a scenario.

    Args:
        output: the folder that gets toolbox/train and so on.
        seed: of all variation.
        scenario: one of `SCENARIOS`.
        jobs: number of processes.
        overwrite: replace bags of the same name.
        progress: called with (bag just written, bags written, bags in all).

    Raises:
        ArgumentError: scenario unknown; jobs or seed out of range.
        ResourceBusyError: a bag of that name exists and `overwrite` is not set.
    """
    if scenario not in SCENARIOS:
        expected = f"one of {sorted(SCENARIOS)}"
        raise ArgumentError.about("scenario", expected, scenario, "Correct the name.")
    if jobs < 1 or seed < 0:
        expected = "jobs >= 1 and seed >= 0"
        raise ArgumentError.about("jobs, seed", expected, (jobs, seed), "Give such numbers.")
    todo = importlib.import_module(SCENARIOS[scenario]).orders(seed)
    for order in todo:
        make_room(output / order.folder, overwrite)
    written = []
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        futures = [pool.submit(_make, scenario, order, output) for order in todo]
        for future in as_completed(futures):
            written.append(future.result())
            progress(written[-1].name, len(written), len(todo))
    return sorted(written)


def record(
    output: Path, seed: int, scenario: str, keep: Callable[[PurePosixPath], bool]
) -> list[Path]:
    """Make the recordings of a scenario that `keep` chooses by their folder, in this process."""
    orders = importlib.import_module(SCENARIOS[scenario]).orders(seed)
    return [_make(scenario, order, output) for order in orders if keep(order.folder)]


def make_room(folder: Path, overwrite: bool) -> None:
    """Make sure that there is no bag of that name.

    Raises:
        ResourceBusyError: there is one, and it is not to be overwritten.
    """
    if folder.exists() and not overwrite:
        cure = "Choose another folder or add --overwrite."
        raise ResourceBusyError.about("output", "no bag of that name", folder, cure)
    if folder.exists():
        shutil.rmtree(folder)


def _make(scenario: str, order: Any, output: Path) -> Path:
    content = importlib.import_module(SCENARIOS[scenario]).content(order, output)
    return write_recording(output / order.folder, *content)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m experiments.generate",
        description="Simulate the demonstrations and test recordings of a scenario.",
    )
    parser.add_argument(
        "--scenario", choices=sorted(SCENARIOS), default="toolbox", help="which (default toolbox)"
    )
    parser.add_argument("--output", type=Path, default=Path("bags"), help="folder for the bags")
    parser.add_argument("--seed", type=int, default=1, help="of all variation (default 1)")
    parser.add_argument("--jobs", type=int, default=2, help="number of processes (default 2)")
    parser.add_argument("--overwrite", action="store_true", help="replace bags of the same name")
    return parser


def main(args: Sequence[str] | None = None) -> int:
    """Run the command; return its exit code."""
    options = _parser().parse_args(args)
    from rich.progress import Progress

    try:
        with Progress() as bar:
            task = bar.add_task(options.scenario, total=None)
            written = generate(
                options.output,
                options.seed,
                scenario=options.scenario,
                jobs=options.jobs,
                overwrite=options.overwrite,
                progress=lambda name, done, total: bar.update(
                    task, completed=done, total=total, description=name
                ),
            )
    except IntentError as error:
        sys.stderr.write(f"generate: {error}\n")
        return 1
    size = sum(f.stat().st_size for folder in written for f in folder.iterdir())
    sys.stdout.write(f"{len(written)} bags of {options.scenario}, {size / 1e6:.1f} MB\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
