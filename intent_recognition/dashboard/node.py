# SPDX-License-Identifier: Apache-2.0
"""Node: a web page that shows the cell, replays recordings, and teaches tasks."""

import gc
import time
from functools import lru_cache, partial
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from rclpy.node import Node
from rclpy.parameter import Parameter

from intent_recognition.bags import BagReader
from intent_recognition.dashboard.cell import CellState
from intent_recognition.dashboard.commands import Commands
from intent_recognition.dashboard.page import DashboardPage
from intent_recognition.dashboard.scene_file import load_scene
from intent_recognition.dashboard.subscriptions import CellSubscriptions
from intent_recognition.dashboard.teaching_session import TeachingSession
from intent_recognition.dashboard.teleoperation import Teleoperation
from intent_recognition.demonstrations import find_bags
from intent_recognition.errors import BagError, IntentError, one_line
from intent_recognition.model import load_model
from intent_recognition.nodes.bag_player import BagPlayer
from intent_recognition.nodes.diagnostics import Diagnostics
from intent_recognition.nodes.parameters import declare
from intent_recognition.nodes.people import meet_all
from intent_recognition.nodes.runtime import run, steady_timer
from intent_recognition.share import share_path

NEVER_PLAYED = ("joint_trajectory", "clock", "diagnostics", "rosout")
"""Topics that a replay does not publish: it must not move a robot that is connected."""


class Dashboard(Node):
    """Node that serves the page and keeps it up to date."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("dashboard", **kwargs)
        given = declare(self, "dashboard")
        bags, body, hand_link = given["bags"], given["body"], given["hand_link"]
        self._models, self._body = given["models"], body
        self._diagnostics = Diagnostics(self)
        self.state = CellState()
        subscriptions = CellSubscriptions(self, self.state, body, self._diagnostics.reject)
        meet_all(self, f"human/{{}}/{body}", subscriptions.meet, set())
        self._commands = Commands(self, lambda ok, text: self.page.show_message(ok, text))
        teleoperation = Teleoperation(self, self.state, body, hand_link=hand_link)
        rng = np.random.default_rng(given["seed"])
        session = TeachingSession(teleoperation, self._commands, rng)
        self.page = DashboardPage(
            given["host"],
            given["port"],
            self.state,
            self._commands,
            teleoperation,
            session,
            bags=(find_bags(Path(bags)) if bags else shipped_bags())[:500],
            models=self._find_models,
            play=self._play,
            stop=self._stop,
            scene=load_scene(given["scene"]) if given["scene"] else None,
            hand_link=hand_link,
            names=given["names"],
            read_only=given["read_only"],
            light=given["light"],
        )
        self.get_logger().info(f"the page is at {self.page.address}")
        steady_timer(self, 1.0 / given["rate"], self._update)
        gc.freeze()

    def destroy_node(self) -> None:
        """Stop serving, then close the node."""
        self.page.close()
        super().destroy_node()

    def _update(self) -> None:
        started = time.perf_counter()
        try:
            self.page.update()
        except IntentError as error:
            self.page.show_message(False, one_line(error))
        self._diagnostics.tick("page")
        self._diagnostics.latency(time.perf_counter() - started)

    def _find_models(self) -> list[Path]:
        folder = Path(self._models)
        depths = ("*.npz", "*/*.npz", "*/*/*.npz")
        found = (path.absolute() for depth in depths for path in sorted(folder.glob(depth)))
        return list(islice(filter(_is_model, found), 50))

    def _play(self, bag: Path, offset_s: float, rate: float) -> BagPlayer:
        """Play the topics that nobody else publishes, restamped; a body as the first person's."""
        stored = [topic.lstrip("/") for topic in BagReader(bag, tolerant=True).topics]
        topics = self.state.pose_topics(self._body)
        played = {topic: topic for topic in stored} | {topics[0]: topics[-1]}
        free = [t for t in stored if t not in NEVER_PLAYED and not self.count_publishers(played[t])]
        if not free:
            cure = "Untick Take the wrist on the tab Teach, or stop the nodes that publish them."
            taken = ", ".join(stored)
            raise BagError.about("Play", "a topic that nobody publishes", f"only {taken}", cure)
        values = {
            "bag": str(bag),
            "start_offset": offset_s,
            "rate": rate,
            "topics": free,
            "restamp": True,
            "exit_at_end": False,
            "wait_for_subscribers": 0.5,
            "use_sim_time": self.get_parameter("use_sim_time").value,
        }
        player = BagPlayer(
            namespace=self.get_namespace(),
            cli_args=["--ros-args", *(["-r", ":=".join(topics)] if len(topics) > 1 else [])],
            parameter_overrides=[Parameter(name, value=value) for name, value in values.items()],
        )
        if self.executor is not None:
            self.executor.add_node(player)
        return player

    def _stop(self, player: BagPlayer) -> None:
        if self.executor is not None:
            self.executor.remove_node(player)
        for timer in player.timers:
            timer.callback = lambda: None  # the executor may have queued it already
        player.destroy_node()


def shipped_bags() -> list[Path]:
    """Shipped recordings, first those that the demo's model fits but was not learned from."""
    bags = share_path("bags")
    return sorted(find_bags(bags), key=lambda bag: not bag.is_relative_to(bags / "toolbox/test"))


def _is_model(path: Path) -> bool:
    """Whether a path is a model file; False if it is gone."""
    try:
        return _was_model(path, path.stat().st_mtime_ns)
    except OSError:
        return False


@lru_cache(maxsize=1000)
def _was_model(path: Path, changed_ns: int) -> bool:
    """Whether a file is a model, cached for each version of the file."""
    try:
        load_model(path)
    except IntentError:
        return False
    return True


main = partial(run, Dashboard)
