# SPDX-License-Identifier: Apache-2.0
"""Publish a bag's messages on their topics in the recorded rhythm. Playing begins when a topic has
a subscriber, or after --wait.

bag BAG    bag directory or .mcap file
--rate R   speed; 1 is the recorded one, 0 as fast as possible (default: 1)
--loop     begin again at the end
--paused   wait for the service ~/resume before the start
--wait S   longest wait for subscribers in seconds (default: 3)
--clock    publish the recorded time on /clock
--restamp  shift header stamps to the present

# to the nodes, stamped with the present
intent play demos/give_bracket_00 --restamp
# slowly, again and again
intent play demos/give_bracket_00 --rate 0.5 --loop --restamp
"""

import argparse

from rich.console import Console

from intent_recognition.bags import BagReader
from intent_recognition.cli.console import progress_bar
from intent_recognition.cli.options import add_node_options, node_arguments, number

PARAMETERS = ("rate", "loop", "start_paused", "wait_for_subscribers", "clock", "restamp")
"""Options that are parameters of the node `bag_player` with the same names."""


OPTIONS = {
    "rate": {"type": number(float, 0), "default": 1.0},
    "paused": {"dest": "start_paused"},
    "wait": {"dest": "wait_for_subscribers", "type": number(float, 0), "default": 3.0},
}
MORE = (add_node_options,)


def run(args: argparse.Namespace) -> int:
    """Play to the end, or until interrupted."""
    BagReader(args.bag, tolerant=True)
    from intent_recognition.nodes.bag_player import BagPlayer
    from intent_recognition.nodes.runtime import run as run_node
    from intent_recognition.nodes.runtime import steady_timer

    with progress_bar(Console(stderr=True)) as bar:
        task = bar.add_task("seconds played", total=None)

        def bag_player() -> BagPlayer:
            node = BagPlayer()
            steady_timer(node, 0.2, lambda: show(node))
            return node

        def show(node: BagPlayer) -> None:
            total = None if args.loop else node.duration_s
            bar.update(task, total=total, completed=node.position_s)

        return run_node(bag_player, node_arguments(args, parameters(args)))


def parameters(args: argparse.Namespace) -> dict[str, object]:
    """The node's parameters."""
    return {"bag": str(args.bag.absolute())} | {name: getattr(args, name) for name in PARAMETERS}
