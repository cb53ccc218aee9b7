# SPDX-License-Identifier: Apache-2.0
"""Physical transfers in simulation: `python -m benchmarks.transfer` measures docs/transfer.md.

Give and take, three objects, the LWR and the Panda; bumps and false pulls; objects that turn wet;
and the transfers with the load signal off. Each trial has a seed of its own.
"""

import argparse
import json
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from benchmarks.measure import Result, at_least, at_most
from benchmarks.transfer_trials import (
    DISTURBANCES,
    TRANSFERS,
    TransferOutcome,
    TransferTrial,
    run_trial,
)
from sim_bridge.scenarios.transfer import OBJECTS

ARMS = ("lwr", "lwr", "panda")
"""Two of three trials are the LWR's."""
WET_OBJECTS = ("plate", "bottle")
"""Those whose slip can be told from the noise of the load."""
CLOCKS_S = (0.25, 2.0)
"""Clocks with the load signal off [s]: that of `sim_bridge.scenarios.toolbox`, and the time in
which these people take an object on average, which no robot knows."""
LARGEST_N, RELEASE_S, NOTICED_S = 15.0, 0.3, 0.05
"""What is required of force, release and slips [N], [s], [s] (issue 35)."""


def transfer(n: int = 200) -> Iterator[Result]:
    """Check n transfers, n disturbances, n / 5 wet objects, and n by clocks.

    Args:
        n: number of trials.
    """
    runs = run(trials(TRANSFERS, n))
    yield at_most("transfers: dropped or not done", _failed(runs), 0, "", f"of {n}")
    peaks = [outcome.peak_n for outcome in runs]
    yield at_most("transfers: largest force on the person", max(peaks), LARGEST_N, "N")
    delays = [one.release_s for one in runs if np.isfinite(one.release_s)]
    yield at_most("transfers: from pull to release, longest", max(delays), RELEASE_S, "s")
    yield at_most("bumps, false pulls: let go", _failed(run(trials(DISTURBANCES, n))), 0, "")
    wet = run(trials(("slippery",), n // 5, WET_OBJECTS))
    noticed = [one.slip_s for one in wet if not np.isnan(one.slip_s)]
    within = float(np.mean(np.array(noticed) <= NOTICED_S))
    remark = f"of {len(noticed)} that slid"
    yield at_least("wet objects: slip noticed within 50 ms", within, 1.0, "", remark)
    yield at_most("wet objects: lost", _failed(wet), 0, "", f"of {len(wet)}")
    for clock_s in CLOCKS_S:
        clock = run(trials(TRANSFERS, n // 2, clock_s=clock_s))
        bad = sum(not one.success or one.peak_n >= LARGEST_N for one in clock)
        remark = f"of {len(clock)}: dropped, not done, or above {LARGEST_N:g} N"
        yield at_least(f"with a clock of {clock_s:g} s instead: failed", bad, 1, "", remark)


def trials(
    kinds: Sequence[str],
    n: int,
    things: Sequence[str] = tuple(OBJECTS),
    clock_s: float | None = None,
) -> list[TransferTrial]:
    """Kinds in turn, with the objects in turn, with the arms in turn."""
    chosen = []
    for seed in range(n):
        turn, kind = divmod(seed, len(kinds))
        turn, thing = divmod(turn, len(things))
        robot = ARMS[turn % len(ARMS)]
        chosen.append(TransferTrial(kinds[kind], things[thing], robot, seed, clock_s))
    return chosen


def run(chosen: Sequence[TransferTrial]) -> list[TransferOutcome]:
    """Do them one after the other; the samples over time are left out."""
    return [run_trial(trial)._replace(samples=[]) for trial in chosen]


def _failed(outcomes: Sequence[TransferOutcome]) -> int:
    return sum(not outcome.success for outcome in outcomes)


def main() -> None:
    """Print the results; `--json OUT` writes them too."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.transfer", description=__doc__)
    parser.add_argument("--trials", type=int, default=200, help="of each (default: %(default)s)")
    parser.add_argument("--json", type=Path, help="write the results there")
    args = parser.parse_args()
    results = []
    for result in transfer(args.trials):
        results.append(result.to_dict())
        print(result.line().rstrip(), flush=True)
    if args.json:
        args.json.write_text(json.dumps(results, indent=1))


if __name__ == "__main__":
    main()
