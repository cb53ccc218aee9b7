# SPDX-License-Identifier: Apache-2.0
"""Physical transfers in simulation: `python -m benchmarks.transfer` measures docs/transfer.md.

Give and take, three objects, the LWR and the Panda; bumps and false pulls; objects that turn wet;
and the transfers with the load signal off. Each trial has a seed of its own.
"""

import argparse
import json
import sys
from collections.abc import Iterator, Mapping, Sequence
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

N_TRIALS = 200
"""Of the transfers, and of the disturbances."""
SCORED_SEED = 10_000
"""First seed. Constants of `intent_recognition.transfer` were chosen on seeds below 1,000."""
ARMS = ("lwr", "lwr", "panda")
"""Two of three trials are the LWR's."""
WET_OBJECTS = ("plate", "bottle")
"""Objects heavy enough for a slip to stand out of the noise of the load."""
CLOCKS_S = (0.25, 2.0)
"""Clocks with the load signal off [s]: soon after the arm rests, and the time in which these people
take an object on average, which no robot knows."""
LARGEST_N, RELEASE_S, NOTICED_S = 15.0, 0.3, 0.05
"""Largest accepted force, time to release, and time until a slip is noticed [N], [s], [s]."""


def transfer(n: int = N_TRIALS) -> Iterator[Result]:
    """Do n transfers, n disturbances, n / 5 with wet objects, and n / 6 by each of two clocks."""
    return results({name: run(chosen) for name, chosen in plan(n).items()})


def plan(n: int) -> dict[str, list[TransferTrial]]:
    """The trials, by what they are for; those of a smaller n come first."""
    clocks = {f"{s:g}": trials(TRANSFERS, n // 6, clock_s=s) for s in CLOCKS_S}
    wet = trials(("slippery",), n // 5, WET_OBJECTS)
    return {
        "transfers": trials(TRANSFERS, n),
        "disturbances": trials(DISTURBANCES, n),
        "wet": wet,
        **clocks,
    }


def results(outcomes: Mapping[str, Sequence[TransferOutcome]]) -> Iterator[Result]:
    """What came of the trials of `plan`."""
    runs, disturbed, wet = (outcomes[name] for name in ("transfers", "disturbances", "wet"))
    of = f"of {len(runs)}"
    peak_n = max(outcome.peak_n for outcome in runs)
    delay_s = max((one.release_s for one in runs if np.isfinite(one.release_s)), default=0.0)
    yield at_most("transfers: dropped or not done", _failed(runs), 0, "", of)
    yield at_most("transfers: largest force on the person", peak_n, LARGEST_N, "N", of)
    yield at_most("robot gives: longest time from pull to release", delay_s, RELEASE_S, "s")
    of = f"of {len(disturbed)}"
    yield at_most("bumps, false pulls: let go, or not brought back", _failed(disturbed), 0, "", of)
    noticed = [one.slip_s for one in wet if not np.isnan(one.slip_s)]
    slip_s, of = max(noticed, default=0.0), f"of {len(noticed)} that slid"
    yield at_most("wet objects: longest time until a slip was noticed", slip_s, NOTICED_S, "s", of)
    yield at_most("wet objects: lost", _failed(wet), 0, "", f"of {len(wet)}")
    for clock_s in CLOCKS_S:
        clock = outcomes[f"{clock_s:g}"]
        bad = sum(not one.success or one.peak_n >= LARGEST_N for one in clock) / len(clock)
        name = f"released after {clock_s:g} s, not by the load: dropped or above {LARGEST_N:g} N"
        yield at_least(name, 100.0 * bad, 0.0, "%", f"of {len(clock)}")


def trials(
    kinds: Sequence[str],
    n: int,
    things: Sequence[str] = ("box", "plate", "bottle"),
    clock_s: float | None = None,
) -> list[TransferTrial]:
    """Kinds in turn, with the objects in turn, with the arms in turn."""
    chosen = []
    for number in range(n):
        turn, kind = divmod(number, len(kinds))
        turn, thing = divmod(turn, len(things))
        robot = ARMS[turn % len(ARMS)]
        seed = SCORED_SEED + number
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
    parser.add_argument(
        "--trials", type=int, default=N_TRIALS, help="of each (default: %(default)s)"
    )
    parser.add_argument("--json", type=Path, help="write the results there")
    args = parser.parse_args()
    found = list(transfer(args.trials))
    sys.stdout.writelines(f"{result.line().rstrip()}\n" for result in found)
    if args.json:
        args.json.write_text(json.dumps([result.to_dict() for result in found], indent=1))


if __name__ == "__main__":
    main()
