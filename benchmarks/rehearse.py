# SPDX-License-Identifier: Apache-2.0
"""`python -m benchmarks.rehearse SET...`: do suggested demonstrations help more than random ones?

Of the recordings of a set some are tested on, some are rehearsed, and the rest is what may be
demonstrated. A model begins with an uneven choice: eight demonstrations of each task, but one of
a task that is drawn. `suggest` sees the model and the rehearsal; each of its five suggestions is
answered by the recording of the task that is the most like the suggested one. A random
demonstration is one of a random task. Misses are test recordings whose task never became active.
"""

import argparse
import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from intent_recognition.demonstrations import load_dofs, read_demonstrations
from intent_recognition.evaluation import Rehearsal, rehearse, suggest_next
from intent_recognition.evaluation.online import where_both_were_recorded
from intent_recognition.learning import (
    Trained,
    cut_to_movement,
    example_of,
    learn,
    learn_with_report,
)
from intent_recognition.promp import TaskLibrary
from intent_recognition.signals import Demonstration, Signal

N_TESTED, N_REHEARSED, N_SUGGESTED = 24, 18, 5
N_RANDOM = 2
"""Random choices that are averaged: few, to bound the time."""
USUAL, SCARCE = 8, 1
"""Demonstrations of each task at the beginning, and of the scarce one."""
MOST_RATE_HZ = 35.0
"""Rate to which recordings are thinned, to bound the time [Hz]."""


def thinned(recorded: Demonstration) -> Demonstration:
    """The recording at a lower rate, without its person: all people demonstrate and are tested."""

    def thin(signal: Signal) -> Signal:
        span_s = (int(signal.stamps_ns[-1]) - int(signal.stamps_ns[0])) * 1e-9
        step = max(round(len(signal.stamps_ns) / span_s / MOST_RATE_HZ), 1)
        return replace(signal, stamps_ns=signal.stamps_ns[::step], values=signal.values[::step])

    signals = (tuple(map(thin, agent)) for agent in (recorded.observed, recorded.controlled))
    observed, controlled = signals
    return replace(recorded, observed=observed, controlled=controlled, metadata={})


def read(folders: Sequence[Path]) -> list[Demonstration]:
    """Labelled recordings, cut to the movement."""
    own = folders[0] / "dofs.yaml"
    found, _ = read_demonstrations(folders, load_dofs(own) if own.exists() else load_dofs())
    cut = cut_to_movement([thinned(one) for one in found])
    return [where_both_were_recorded(one) for one in cut]


def trial(recordings: Sequence[Demonstration], seed: int) -> dict[str, Any]:
    """Misses before, after random demonstrations and after suggested ones."""
    rng = np.random.default_rng(seed)
    tasks = sorted({str(one.task) for one in recordings})
    shuffled = [recordings[i] for i in rng.permutation(len(recordings))]
    tested, rest = shuffled[:N_TESTED], shuffled[N_TESTED:]
    rehearsed, rest = rest[:N_REHEARSED], rest[N_REHEARSED:]
    scarce = tasks[rng.integers(len(tasks))]
    numbers = [
        [k for k, one in enumerate(rest) if one.task == task][: SCARCE if task == scarce else USUAL]
        for task in tasks
    ]
    chosen = {k for own in numbers for k in own}
    begun = [rest[k] for k in sorted(chosen)]
    pool = [one for k, one in enumerate(rest) if k not in chosen]
    report = learn_with_report(begun)
    rehearsal = rehearse(report.library, rehearsed)
    after_random = [at_random(rng, pool, tasks) for _ in range(N_RANDOM)]
    suggested = as_suggested(report.trained, rehearsal, pool)

    def counts(library: TaskLibrary) -> tuple[int, int]:
        found = rehearse(library, tested)
        return found.n_missed, found.n_wrong

    by_random = [counts(learn([*begun, *some])) for some in after_random]
    return {
        "seed": seed,
        "scarce": scarce,
        "suggested": [one.task for one in suggested],
        "tested": len(tested),
        "before": counts(report.library),
        "random": np.mean(by_random, axis=0).tolist(),
        "after": counts(learn([*begun, *suggested])),
    }


def at_random(
    rng: np.random.Generator, pool: Sequence[Demonstration], tasks: Sequence[str]
) -> list[Demonstration]:
    """Demonstrations of random tasks."""
    left, found = list(pool), []
    for _ in range(N_SUGGESTED):
        task = tasks[int(rng.integers(len(tasks)))]
        own = [k for k, one in enumerate(left) if one.task == task]
        found.append(left.pop(own[int(rng.integers(len(own)))]))
    return found


def as_suggested(
    trained: Trained, rehearsal: Rehearsal, pool: Sequence[Demonstration]
) -> list[Demonstration]:
    """For each suggestion, the recording of its task most like it."""
    offered = [example_of(one, trained.preprocessing) for one in pool]
    left, found = set(range(len(pool))), []
    for one in suggest_next(trained, rehearsal, N_SUGGESTED):
        wanted = example_of(rehearsal.runs[one.like].recorded, trained.preprocessing).observed
        own = [k for k in left if pool[k].task == one.task]
        best = min(own, key=lambda k: float(np.sum((offered[k].observed - wanted) ** 2)))
        left.remove(best)
        found.append(pool[best])
    return found


def main() -> None:
    """Print a line for each trial, and the sums."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("folders", nargs="+", type=Path, help="of one set")
    parser.add_argument(
        "--seeds", nargs=2, type=int, default=(0, 10), help="the first, and the one behind the last"
    )
    options = parser.parse_args()
    recordings, found = read(options.folders), []
    for seed in range(*options.seeds):
        found.append(trial(recordings, seed))
        print(json.dumps(found[-1]), flush=True)
    missed = {
        name: np.array([one[name][0] for one in found]) for name in ("before", "random", "after")
    }
    total = {name: float(values.sum()) for name, values in missed.items()}
    print(f"missed of {len(found) * N_TESTED}: {total}")
    random, suggested = (total["before"] - total[name] for name in ("random", "after"))
    print(f"fewer misses by five random ones {random}, by five suggested ones {suggested}")


if __name__ == "__main__":
    main()
