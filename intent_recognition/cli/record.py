# SPDX-License-Identifier: Apache-2.0
"""Record topics, bit for bit, into a new MCAP bag until Ctrl-C.

topics TOPIC  topics to record (default: all there are)
--output BAG  directory of the new bag
--task TASK   label of the demonstration

# a demonstration of a task
intent record --task give_bracket --output demos/give_bracket_00
  /mocap/wrist/pose /joint_states
# everything there is
intent record --output session_00
"""

import argparse

from intent_recognition.cli.options import add_node_options, node_arguments, topic_name
from intent_recognition.errors import ResourceBusyError

OPTIONS = {
    "topics": {"type": topic_name, "nargs": "*"},
    "output": {"required": True},
    "task": {"default": ""},
}
MORE = (add_node_options,)


def run(args: argparse.Namespace) -> int:
    """Record until interrupted."""
    if args.output.exists():
        cure = "Choose another; existing recordings are never overwritten."
        raise ResourceBusyError.about("--output", "a new directory", str(args.output), cure)
    from intent_recognition.nodes.bag_recorder import main

    return main(node_arguments(args, parameters(args)))


def parameters(args: argparse.Namespace) -> dict[str, object]:
    """The node's parameters."""
    chosen = {"output": str(args.output.absolute()), "task": args.task}
    return chosen | ({"topics": list(args.topics)} if args.topics else {})
