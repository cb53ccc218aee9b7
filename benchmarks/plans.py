# SPDX-License-Identifier: Apache-2.0
"""How well a plan predicts the next task, beside the Markov table of the same demonstrations.

    python benchmarks/plans.py [--first 100] [--seeds 10]

Simulated assemblies of `test/assemblies.py`; the figures of docs/plans.md.
"""

import argparse
import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "test"))

from assemblies import FOREIGN, Job, build, make_job  # type: ignore[import-not-found]

from intent_recognition.learning import count_transitions, smoothed_transitions
from intent_recognition.plans import DoneTask, WorkPlan, WorkProgress, learn_plan

SLIPS = 0.02
"""Of each kind, a movement."""
LOG_ODDS = 8.0
"""Mean log odds that the simulated recogniser gives the true task against each other one; standard
normal noise is added. About one of a thousand is misrecognised."""


def known(plan: WorkPlan, job: Job) -> WorkPlan:
    """The plan with all true relations by hand."""
    steps = [
        f"{label} {n}" if (n := job.labels[: k + 1].count(label)) > 1 else label
        for k, label in enumerate(job.labels)
    ]
    pairs = [(i, j) for i in range(len(steps)) for j in range(len(steps)) if i != j]
    named = {*steps} & set(plan.names)
    by_hand = {
        (steps[i], steps[j]): float(i in job.needs[j])
        for i, j in pairs
        if {steps[i], steps[j]} <= named
    }
    return replace(plan, by_hand=by_hand)


def score(
    seed: int, n_demonstrations: int, slips: float, by_hand: bool = False, n_assemblies: int = 10
) -> Counter:
    """Counts of ten assemblies that are followed by a plan of a few."""
    rng = np.random.default_rng(seed)
    job = make_job(rng)
    labels = tuple(sorted({*job.labels, FOREIGN}))
    shown = [[act.label for act in build(rng, job, slips)] for _ in range(n_demonstrations)]
    plan = learn_plan([tuple(map(DoneTask, one)) for one in shown], rng)
    plan = known(plan, job) if by_hand else plan
    table = smoothed_transitions(count_transitions(shown, labels))
    out: Counter = Counter()
    for _ in range(n_assemblies):
        progress, last = WorkProgress(plan, labels), len(labels)
        missing: set[str] = set()
        said: set[str] = set()
        late: set[str] = set()
        for act in build(rng, job, SLIPS):
            habit = table[last]
            p, k = progress.next_tasks(), labels.index(act.label)
            out["movements"] += 1
            out["loss"] -= np.log(p[k])
            out["loss of table"] -= np.log(habit[k])
            out["possible"] += labels[np.argmax(p)] in act.allowed
            if act.step >= 0 and act.allowed == {act.label}:
                out["decidable"] += 1
                out["right"] += np.argmax(p) == k
                out["right of table"] += np.argmax(habit) == k
            seen = np.exp(rng.normal(size=len(labels)) + LOG_ODDS * (np.arange(len(labels)) == k))
            posterior = np.r_[p * seen, 1e-4 * np.exp(LOG_ODDS)]
            progress.take(posterior / posterior.sum())
            last = k
            now = {step.task for step in progress.steps() if str(step) == "forgotten"}
            new = {job.labels[step] for step in act.missing} - missing
            missing |= new
            out["forgotten"] += len(new)
            out["at once"] += len(new & now)
            out["by the next"] += len(new & now) + len(late & now)
            late = new - now
            out["false"] += len(now - said - missing)
            said |= now
    return out


def main() -> None:
    """Print a line for each kind of demonstrations."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--first", type=int, default=100, help="seed; 0 to 39 chose the constants")
    parser.add_argument("--seeds", type=int, default=10)
    options = parser.parse_args()
    seeds = range(options.first, options.first + options.seeds)
    print(
        "| demonstrations | right of decidable | table | log loss / table's"
        " | one that may come | forgotten, told at once | by the next movement"
        " | false a hundred movements |"
    )
    print("|---|---|---|---|---|---|---|---|")
    for n, slips, by_hand in (
        (2, 0.0, False),
        (2, SLIPS, False),
        (5, 0.0, False),
        (5, SLIPS, False),
        (10, SLIPS, False),
        (2, 0.0, True),
    ):
        c = sum((score(seed, n, slips, by_hand) for seed in seeds), Counter())
        print(
            f"| {n}, {'with slips' if slips else 'clean'}{', all relations by hand' * by_hand}"
            f" | {c['right'] / c['decidable']:.1%} of {c['decidable']}"
            f" | {c['right of table'] / c['decidable']:.1%}"
            f" | {c['loss'] / c['loss of table']:.2f}"
            f" | {c['possible'] / c['movements']:.1%}"
            f" | {c['at once']} of {c['forgotten']}"
            f" | {c['by the next']}"
            f" | {100 * c['false'] / c['movements']:.1f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
