# SPDX-License-Identifier: Apache-2.0
"""`intent demo --scenario pouring`: pour with containers never demonstrated. Needs no ROS 2."""

import argparse
import time
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table

from intent_recognition.cli.console import busy, escape
from intent_recognition.cli.output import PRINTED, write_json
from intent_recognition.share import share_path

if TYPE_CHECKING:
    from sim_bridge.scenarios.pouring import Planned, Poured, PourOrder

DEFAULT_POURS = 2
MANY_SPILLED = 2.0
"""Spilled balls of forty, on average, above which the demo has failed. Convention."""

Done = tuple["PourOrder", "Planned", "Poured"]


def run_pouring(args: argparse.Namespace, console: Console) -> int:
    """Learn from the shipped demonstrations and pour; 1 if more than two of 40 are spilled."""
    started = time.monotonic()
    done = []
    for order in _orders(args):
        done.append(_pour(order, console))
    if args.json != PRINTED:
        console.print(_table(done))
    spilled = [poured.spilled for *_, poured in done]
    write_json(args.json, [_numbers(*one) for one in done])
    mean = sum(spilled) / len(spilled)
    console.file.write(
        f"poured with {len(done)} pairs never demonstrated: {mean:.1f} of {done[0][2].n_balls}"
        f" balls spilled on average, {time.monotonic() - started:.0f} s\n"
    )
    console.file.flush()
    return 1 if mean > MANY_SPILLED else 0


def _orders(args: argparse.Namespace) -> "list[PourOrder]":
    from sim_bridge.scenarios.pouring import MEAN, PAIRS, PourOrder

    count = min(args.interactions or DEFAULT_POURS, len(PAIRS))
    return [PourOrder(args.seed, pair, MEAN) for pair in range(count)]


def _pour(order: "PourOrder", console: Console) -> Done:
    from sim_bridge.scenarios.pouring import PAIRS, execute, learn_skill, planned

    names = " into ".join(PAIRS[order.pair]).replace("_", " ")
    with busy(console, f"pouring from {names}"):
        skill = learn_skill(share_path("bags/pouring/train"), order.seed)
        plan = planned(order, skill)
        return order, plan, execute(order, plan)


def _numbers(order: "PourOrder", plan: "Planned", poured: "Poured") -> dict[str, object]:
    from sim_bridge.scenarios.pouring import PAIRS

    cup, second = PAIRS[order.pair]
    return {
        "cup": cup,
        "second": second,
        "cup_references": plan.cup.references._asdict(),
        "second_references": plan.second.references._asdict(),
        "spill_expected": plan.risk,
        "balls": poured.n_balls,
        "caught": poured.caught,
        "kept": poured.kept,
        "spilled": poured.spilled,
    }


def _table(done: list[Done]) -> Table:
    table = Table(title="pours with the references of a scan")
    table.add_column("pair")
    for name in ("opening [mm]", "height [mm]", "tilt [deg]", "spill expected"):
        table.add_column(escape(name), justify="right")
    for name in ("in", "left in cup", "spilled"):
        table.add_column(name, justify="right")
    for one in done:
        row = _numbers(*one)
        _, plan, _ = one
        cup, second = plan.cup.references, plan.second.references
        table.add_row(
            f"{row['cup']} into {row['second']}".replace("_", " "),
            f"{1e3 * second.opening_radius_m:.1f}",
            f"{1e3 * cup.height_m:.1f}",
            f"{57.29578 * cup.tilt_rad:.1f}",
            f"{plan.risk:.2f}",
            *(str(row[name]) for name in ("caught", "kept", "spilled")),
        )
    return table
