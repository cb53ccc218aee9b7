# SPDX-License-Identifier: Apache-2.0
"""`intent demo --scenario pouring`: a graph of nodes pours with containers never demonstrated."""

import argparse
import os
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from rich.console import Console
from rich.table import Table

from intent_recognition.cli.console import boxed_table, busy, say
from intent_recognition.cli.demo_session import refuse_options, waits_for_answers, watched_graph
from intent_recognition.cli.output import table_console, write_json
from intent_recognition.cli.session_watch import NodeWatch
from intent_recognition.errors import ArgumentError, IntentError
from intent_recognition.model import load_pouring_skill, save_pouring_skill
from intent_recognition.nodes.graph import resolve
from intent_recognition.share import share_path
from intent_recognition.warping import amount_to_leave

if TYPE_CHECKING:
    from intent_recognition.nodes.demo_observers import PouringObserver


class Done(NamedTuple):
    """One pour of the demo: both containers, their warped parameters, and counts of balls."""

    cup: str
    second: str
    parameters: dict[str, dict[str, float]]
    balls: dict[str, int]

    @property
    def n_balls(self) -> int:
        """Number of balls in the cup at the start."""
        return sum(self.balls[name] for name in ("in_cup", "in_second", "spilled"))


def run_pouring(args: argparse.Namespace, console: Console) -> int:
    """Learn from the shipped demonstrations and pour; 1 if over two of 40 balls are spilled."""
    from sim_bridge.scenarios.pouring import balls_above_m, learn_pouring_skill

    _check(args)
    started, pairs = time.monotonic(), _pairs(args)
    if args.model is None:
        with busy(console, "learning from ten demonstrations with another pair"):
            skill = learn_pouring_skill(share_path("bags/pouring/train"), args.seed)
            path = save_pouring_skill(args.output / "pouring.npz", skill)
    else:
        load_pouring_skill(path := args.model)
    done = [_pour(args, path, cup, second, balls_above_m(cup), console) for cup, second in pairs]
    table_console(args).print(_table(done, args.pour))
    write_json(args.json, [_numbers(one, args.pour) for one in done])
    mean = sum(one.balls["spilled"] for one in done) / len(done)
    spilled = f"{mean:.1f} of {done[0].n_balls} balls spilled on average"
    taken_s = time.monotonic() - started
    say(console, f"pairs never demonstrated: {len(done)}; {spilled}, {taken_s:.0f} s")
    return 1 if mean > 2.0 else 0


def _check(args: argparse.Namespace) -> None:
    """Refuse options of the other scenarios before anything is learned or started."""
    usual: dict[str, object] = dict.fromkeys(("record", "sequences", "params", "transfers"))
    usual |= {"dashboard": False, "arm": "lwr", "changes": 0, "task_list": "habit"}
    cure = "Leave it out, or choose another --scenario."
    refuse_options(args, usual, "--scenario pouring", cure)
    amount_to_leave(args.pour, 1.0, 1.0)


def _pairs(args: argparse.Namespace) -> Sequence[tuple[str, str]]:
    from sim_bridge.containers import CONTAINER_NAMES
    from sim_bridge.scenarios.pouring import PAIRS

    if args.pair is None:
        return PAIRS[: args.interactions or 2]
    cup, _, second = args.pair.partition(",")
    if not {cup, second} <= set(CONTAINER_NAMES):
        expected = f"two of {', '.join(CONTAINER_NAMES)}, with a comma"
        cure = "Name the one in the hand first."
        raise ArgumentError.about("--pair", expected, args.pair, cure)
    return [(cup, second)]


def _pour(
    args: argparse.Namespace, skill: Path, cup: str, second: str, above_m: float, console: Console
) -> Done:
    """Start the nodes of the graph `pouring`, request a pour and wait for its end."""
    from intent_recognition.nodes.demo_observers import PouringObserver

    given = {
        "skill": str(skill.resolve()),
        "cup": cup,
        "second": second,
        "stands_above": above_m,
        "rate": float(args.rate),
        "headless": args.headless or not os.environ.get("DISPLAY"),
        "sensor_noise": True,
        "seed": args.seed,
    }
    names = f"{cup} into {second}".replace("_", " ")
    with (
        busy(console, f"pouring from {names}"),
        watched_graph(args, console, PouringObserver) as (observer, watch),
    ):
        for call in resolve("pouring", given, {"lwr_sim": waits_for_answers(person=False)}):
            watch.processes.start(call.name, call.module, call.parameters, call.remappings)
        _follow(args, observer, watch)
        counts = {name: int(value) for name, value in observer.balls.items()}
        return Done(cup, second, observer.parameters, counts)


def _follow(args: argparse.Namespace, observer: "PouringObserver", watch: NodeWatch) -> None:
    watch.until(observer.is_ready, 180.0, "the containers, seen and warped")
    observer.ask(args.pour)
    watch.until(lambda: bool(observer.active or observer.refused), 60.0, "the pour")
    if not observer.active:
        cure = "See the log of warped_primitive."
        expected = "a pour that the learned constraints allow"
        raise IntentError.about("pour", expected, observer.refused, cure)
    watch.until(lambda: not observer.active, 600.0, "the pour's end")
    watch.for_seconds(1.0 / args.rate)


def _numbers(done: Done, asked: str) -> dict[str, object]:
    cup, second = (done.parameters[name] for name in ("cup", "second"))
    balls, volume_m3 = done.balls, cup["volume_m3"]
    left = amount_to_leave(asked, 0.5 * volume_m3, second["volume_m3"]) / volume_m3
    return {
        "cup": done.cup,
        "second": done.second,
        "cup_parameters": cup,
        "second_parameters": second,
        "pour": asked,
        "balls": done.n_balls,
        "to_be_left": 2.0 * done.n_balls * left,
        "caught": balls["in_second"],
        "kept": balls["in_cup"],
        "spilled": balls["spilled"],
        "through_wall": balls["through_wall"],
    }


def _table(done: list[Done], asked: str) -> Table:
    title = f"pours ({asked}) with the parameters of what was seen"
    sizes = (">opening [mm]", ">height [mm]", ">tilt [deg]")
    table = boxed_table(title, "pair", *sizes, ">in", ">to be left", ">left in cup", ">spilled")
    for one in done:
        row, parameters = _numbers(one, asked), one.parameters
        table.add_row(
            f"{one.cup} into {one.second}".replace("_", " "),
            f"{1e3 * parameters['second']['opening_radius_m']:.1f}",
            f"{1e3 * parameters['cup']['height_m']:.1f}",
            f"{57.29578 * parameters['cup']['tilt_reference_rad']:.1f}",
            *(f"{row[name]:.0f}" for name in ("caught", "to_be_left", "kept", "spilled")),
        )
    return table
