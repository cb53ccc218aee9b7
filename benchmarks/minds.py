# SPDX-License-Identifier: Apache-2.0
"""`python -m benchmarks.minds`: who is followed when the mind changes, and how early all is known.

Reaches of `benchmarks.reaches` before the online estimator and the decision of the nodes.
"""

import argparse
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from itertools import permutations
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks import reaches
from benchmarks.reaches import CHANGES, Reach
from intent_recognition.demonstrations import load_dofs, read_demonstrations
from intent_recognition.learning import cut_to_movement, learn
from intent_recognition.promp import NONE, TaskLibrary
from intent_recognition.recognition import DecisionState, IntentEstimator, decide, decision_settings

SHARES = (0.15, 0.25, 0.4, 0.6)
"""Shares of the movement at which the mind changes."""
AFTER_S = 0.3
"""What is active so long after the end counts [s]."""


class Outcome(NamedTuple):
    """What became of one reach.

    Attributes:
        final: task active at the end.
        active: all that became active, in order.
        let_go: whether a task was let go of with nothing in its place.
        share: of the movement when the first became active; NaN if none did.
    """

    final: str
    active: tuple[str, ...]
    let_go: bool
    share: float


def follow(library: TaskLibrary, seed: Sequence[int], reach: Reach) -> Outcome:
    """Show a reach to the estimator, and decide as the nodes do."""
    settings, state = decision_settings(library), DecisionState()
    estimator = IntentEstimator(library)
    active, let_go, share, final = list[str](), False, np.nan, ""
    for time_s, position in zip(*reaches.seen(np.random.default_rng(seed), reach), strict=True):
        if time_s > reach.duration_s + AFTER_S:
            break
        estimate = estimator.observe(time_s + 2.0, position)
        best = int(np.argmax(estimate.probabilities))
        needed = estimate.labels[best] not in (NONE, state.active)
        end_std = estimator.predicted_end_std() if needed else None
        state, now = decide(
            settings, state, estimate.labels, estimate.probabilities, end_std, estimate.log_evidence
        )
        if state.event == "over":  # the hand rests: what was active until now counts
            break
        final = now
        let_go |= state.event == "withdrawn"
        if now and (not active or active[-1] != now):
            share = time_s / reach.duration_s if not active else share
            active.append(now)
    return Outcome(final, tuple(active), let_go, share)


class Case(NamedTuple):
    """A reach, the cell of the table that it belongs to, and the seed of its noise."""

    cell: str
    reach: Reach
    seed: tuple[int, ...]


def drawn(rng: np.random.Generator, task: str) -> Reach:
    """A reach of the tasks half a metre apart."""
    return reaches.draw(rng, task)


class Recorded:
    """Draws from the recorded test reaches of the toolbox."""

    def __init__(self, folder: Path):
        found, _ = read_demonstrations([folder], load_dofs())
        self.reaches = [reaches.recorded(one) for one in cut_to_movement(found)]

    def __call__(self, rng: np.random.Generator, task: str) -> Reach:
        own = [reach for reach in self.reaches if reach.task == task]
        return own[rng.integers(len(own))]


def cases(
    draw: Callable[[np.random.Generator, str], Reach],
    labels: Sequence[str],
    n: int,
    seed: int,
    kinds: Sequence[str],
) -> Iterator[Case]:
    """n changes for each ordered pair of tasks, kind and share; 10 n unchanged, 10 n of no task."""
    for pair, (old, new) in enumerate(permutations(labels, 2)):
        for kind in kinds:
            for share in SHARES:
                for k in range(n):
                    key = (seed, pair, k)
                    rng = np.random.default_rng(key)
                    reach = CHANGES[kind](rng, draw(rng, old), draw(rng, new), share)
                    yield Case(f"{kind:12} {share:4.0%}", reach, key)
    for k in range(10 * n):
        key = (seed, 99, k)
        rng = np.random.default_rng(key)
        yield Case("unchanged", draw(rng, labels[k % len(labels)]), key)
        if draw is drawn:
            goal = list(reaches.ELSEWHERE)[k % len(reaches.ELSEWHERE)]
            yield Case("unknown", reaches.draw(rng, goal, reaches.ELSEWHERE), key)


def line(cell: str, found: Sequence[tuple[Reach, Outcome]]) -> str:
    """A row of the table."""
    n = len(found)
    share = [o.share for r, o in found if not np.isnan(o.share)]
    numbers = {
        "new active": sum(bool(r.task) and o.final == r.task for r, o in found),
        "old kept": sum(bool(r.before) and o.final == r.before for r, o in found),
        "others": sum(bool({*o.active} - {r.task, r.before}) for r, o in found),
        "never": sum(not o.active for r, o in found),
        "switched": sum(len(o.active) > 1 for r, o in found),
        "let go": sum(o.let_go for r, o in found),
    }
    text = "  ".join(f"{name} {100 * count / n:3.0f} %" for name, count in numbers.items())
    return (
        f"{cell:20} n {n:4}  {text}  first at {100 * np.median(share) if share else np.nan:3.0f} %"
    )


def run(library: TaskLibrary, todo: Sequence[Case], processes: int) -> list[Outcome]:
    """Follow all cases."""
    one = partial(_follow, library)
    if processes < 2:
        return [one(case) for case in todo]
    with ProcessPoolExecutor(processes) as pool:
        return list(pool.map(one, todo, chunksize=4))


def _follow(library: TaskLibrary, case: Case) -> Outcome:
    return follow(library, case.seed, case.reach)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--n", type=int, default=1, help="of each cell and ordered pair of tasks")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--tasks", choices=("apart", "toolbox"), default="apart")
    parser.add_argument("--kinds", nargs="*", default=list(CHANGES), choices=list(CHANGES))
    options = parser.parse_args()
    if options.tasks == "apart":
        library = learn(reaches.demonstrations(np.random.default_rng([options.seed, 7])))
        draw: Callable[[np.random.Generator, str], Reach] = drawn
    else:
        library = learn(read_demonstrations([Path("bags/toolbox/train")], load_dofs())[0])
        draw = Recorded(Path("bags/toolbox/test"))
    print(f"none margin {library.none_margin:.1f}, switch margin {library.switch_margin:.1f} nats")
    todo = list(cases(draw, library.labels, options.n, options.seed, options.kinds))
    outcomes = run(library, todo, options.processes)
    cells: dict[str, list[tuple[Reach, Outcome]]] = {}
    for case, outcome in zip(todo, outcomes, strict=True):
        cells.setdefault(case.cell, []).append((case.reach, outcome))
    for cell, found in cells.items():
        print(line(cell, found), flush=True)


if __name__ == "__main__":
    main()
