# SPDX-License-Identifier: Apache-2.0
"""Make all trials of the pouring experiments: `python -m experiments.constraints.dataset`.

Every block of trials is a file of its own beside the output until all are done. A run that was
interrupted goes on where it was; the result depends on the seed alone.
"""

import argparse
import json
import shutil
import signal
import sys
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from experiments.constraints.trials import COLUMNS, TRIALS_PER_OBJECT, TrialBlock, blocks, make
from experiments.constraints.trials_file import write_trials
from intent_recognition import __version__
from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError, IntentError, ResourceBusyError
from sim_bridge.containers import CONTAINER_SEED


def generate(
    output: Path,
    seed: int,
    *,
    trials: int = TRIALS_PER_OBJECT,
    jobs: int = 2,
    progress: Callable[[str, int, int], None] = lambda name, done, total: None,
) -> dict[str, Floats]:
    """Make what is missing, and write the file when all is there.

    Args:
        output: the .npz to write; unfinished work is kept in a folder beside it.
        seed: of all variation.
        trials: per object and experiment.
        jobs: number of processes.
        progress: called with (block just made, blocks made, blocks in all).

    Raises:
        ArgumentError: jobs, seed or trials out of range.
        ResourceBusyError: the folder beside it holds work with other settings.
    """
    if jobs < 1 or seed < 0 or trials < 1:
        got = (jobs, seed, trials)
        expected = "jobs >= 1, seed >= 0, trials >= 1"
        raise ArgumentError.about("jobs, seed, trials", expected, got, "Give such numbers.")
    origin = _origin(seed, trials)
    parts = _parts_folder(output, origin)
    todo = blocks(seed, trials)
    missing = [block for block in todo if not _part(parts, block).is_file()]
    done = len(todo) - len(missing)
    progress("found", done, len(todo))
    if missing:
        _make_all(missing, parts, jobs, lambda name, k: progress(name, done + k, len(todo)))
    rows = _write(output, parts, todo, origin)
    shutil.rmtree(parts)
    return rows


def _origin(seed: int, trials: int) -> dict[str, int]:
    return {"seed": seed, "trials_per_object": trials, "container_seed": CONTAINER_SEED}


def _write(
    output: Path, parts: Path, finished: list[TrialBlock], origin: Mapping[str, int]
) -> dict[str, Floats]:
    rows = {
        name: np.concatenate(
            [np.load(_part(parts, block)) for block in finished if block.experiment == name]
        )
        for name in COLUMNS
    }
    write_trials(output, rows, {**origin, "generator_version": __version__})
    return rows


def _make_all(
    missing: list[TrialBlock], parts: Path, jobs: int, made: Callable[[str, int], None]
) -> None:
    # Ctrl-C is for this process, which then ends the others.
    pool = ProcessPoolExecutor(
        jobs, get_context("spawn"), signal.signal, (signal.SIGINT, signal.SIG_IGN)
    )
    try:
        futures = {pool.submit(_make_part, block, parts): block for block in missing}
        for count, future in enumerate(as_completed(futures), 1):
            future.result()
            made(futures[future].name, count)
    finally:
        pool.shutdown(cancel_futures=True)


def _make_part(block: TrialBlock, parts: Path) -> None:
    path = _part(parts, block)
    half = path.with_suffix(".half")
    with half.open("wb") as stream:
        np.save(stream, make(block))
    half.replace(path)


def _part(parts: Path, block: TrialBlock) -> Path:
    return parts / f"{block.name}.npy"


def _parts_folder(output: Path, origin: dict[str, int]) -> Path:
    """The folder of finished blocks, made or found again."""
    parts = output.with_name(output.name + ".parts")
    note = parts / "origin.json"
    if note.is_file() and json.loads(note.read_text(encoding="utf-8")) != origin:
        cure = f"Go on with those settings, or delete {parts}."
        got = note.read_text(encoding="utf-8")
        raise ResourceBusyError.about(str(parts), f"work with {origin}", got, cure)
    parts.mkdir(parents=True, exist_ok=True)
    note.write_text(json.dumps(origin), encoding="utf-8")
    return parts


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m experiments.constraints.dataset",
        description="Simulate the pouring and filling trials with balls. Goes on where an"
        " interrupted run stopped.",
    )
    default = Path("config/pouring_trials.npz")
    parser.add_argument("--output", type=Path, default=default, help=f"file (default {default})")
    parser.add_argument("--seed", type=int, default=1, help="of all variation (default 1)")
    parser.add_argument("--jobs", type=int, default=2, help="number of processes (default 2)")
    parser.add_argument(
        "--trials",
        type=int,
        default=TRIALS_PER_OBJECT,
        help="per object and experiment (default %(default)s)",
    )
    return parser


def main(args: Sequence[str] | None = None) -> int:
    """Run the command; return its exit code."""
    options = _parser().parse_args(args)
    from rich.progress import Progress

    try:
        with Progress() as bar:
            task = bar.add_task("blocks", total=None)
            rows = generate(
                options.output,
                options.seed,
                trials=options.trials,
                jobs=options.jobs,
                progress=lambda name, done, total: bar.update(
                    task, completed=done, total=total, description=name
                ),
            )
    except IntentError as error:
        sys.stderr.write(f"dataset: {error}\n")
        return 1
    except KeyboardInterrupt:
        sys.stderr.write("dataset: interrupted; the same command goes on from here\n")
        return 130
    for name, table in rows.items():
        through = int(table[:, COLUMNS[name].index("through_wall")].sum())
        sys.stdout.write(f"{name}: {len(table)} trials, {through} balls through a wall\n")
    sys.stdout.write(f"{options.output}: {options.output.stat().st_size / 1e3:.0f} kB\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
