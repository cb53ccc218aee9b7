# SPDX-License-Identifier: Apache-2.0
"""The node of each executable, and what it does not start without."""

import importlib

from bag_builder import write_bag
from dashboard.browser import free_port
from rclpy.node import Node

from intent_recognition.registry import NODES


def node_class(name):
    """The node of an executable: the Node its module defines."""
    module = importlib.import_module(NODES[name].module)
    (found,) = [
        member
        for member in vars(module).values()
        if isinstance(member, type)
        and issubclass(member, Node)
        and member.__module__ == module.__name__
    ]
    return found


def needed(name, folder):
    """Parameters without which a node does not start, and what is not taken on this machine."""
    if name == "bag_player":
        return {"bag": str(write_bag(folder / "bag")), "start_paused": True}
    if name == "task_teacher":
        return {"library": str(folder / "tasks")}
    return {"port": free_port()} if name == "dashboard" else {}
