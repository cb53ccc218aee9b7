# SPDX-License-Identifier: Apache-2.0
"""`intent play`: the player node from the terminal."""

import argparse

from rich.console import Console
from rich.progress import TextColumn

from intent_recognition.bags import BagReader
from intent_recognition.cli.console import bar_with
from intent_recognition.cli.help import examples
from intent_recognition.cli.options import (
    Subparsers,
    a_path,
    add_node_options,
    node_arguments,
    number,
)

PARAMETERS = ("rate", "loop", "start_paused", "wait_for_subscribers", "clock", "restamp")
"""Options that are parameters of the node `bag_player` under these names."""

SECONDS = "{task.completed:.1f} of {task.total:.1f} s"
SHOWN_EVERY_S = 0.2
"""Time between two updates of the progress bar [s]. Convention."""


def add_parser(subparsers: Subparsers) -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "play",
        description="Publish a bag's messages on their topics in the recorded rhythm. Playing"
        " begins when a topic has a subscriber, or after --wait.",
        **examples(
            (
                "to the nodes, stamped with the present",
                "intent play demos/give_bracket_00 --restamp",
            ),
            ("slowly, again and again", "intent play demos/give_bracket_00 --rate 0.5 --loop"),
        ),
    )
    parser.add_argument("bag", type=a_path, metavar="BAG", help="bag directory or .mcap file")
    parser.add_argument(
        "--rate",
        type=number(float, 0),
        default=1.0,
        metavar="R",
        help="speed; 1 is the recorded one, 0 as fast as possible (default: 1)",
    )
    parser.add_argument("--loop", action="store_true", help="begin again at the end")
    parser.add_argument(
        "--paused",
        dest="start_paused",
        action="store_true",
        help="wait for the service ~/resume before the start",
    )
    parser.add_argument(
        "--wait",
        dest="wait_for_subscribers",
        type=number(float, 0),
        default=3.0,
        metavar="S",
        help="longest wait for subscribers in seconds (default: 3)",
    )
    parser.add_argument("--clock", action="store_true", help="publish the recorded time on /clock")
    parser.add_argument("--restamp", action="store_true", help="shift header stamps to the present")
    add_node_options(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Play to the end, or until interrupted.

    Raises:
        BagError: there is no recording at this path.
    """
    BagReader(args.bag, tolerant=True)
    from intent_recognition.nodes.bag_player import BagPlayer
    from intent_recognition.nodes.runtime import run as run_node
    from intent_recognition.nodes.runtime import steady_timer

    stderr = Console(stderr=True)
    with bar_with(stderr, TextColumn(SECONDS)) as bar:
        task = bar.add_task("playing", total=None)

        def bag_player() -> BagPlayer:
            node = BagPlayer()
            steady_timer(node, SHOWN_EVERY_S, lambda: show(node))
            return node

        def show(node: BagPlayer) -> None:
            bar.update(task, total=node.duration_s, completed=node.position_s)

        return run_node(bag_player, node_arguments(args, parameters(args)))


def parameters(args: argparse.Namespace) -> dict[str, object]:
    """The node's parameters."""
    return {"bag": str(args.bag.absolute())} | {name: getattr(args, name) for name in PARAMETERS}
