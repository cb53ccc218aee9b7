# SPDX-License-Identifier: Apache-2.0
"""The README's moving picture: the page, while the arm helps the simulated coworker.

`python docs/images/moving.py` runs a short `intent demo` and records it, feeds the recording into
the page message by message, and takes a picture of the page at every moment. `--bag` and `--model`
take a session that was recorded before.
"""

import argparse
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import rclpy
from PIL import Image
from playwright.sync_api import sync_playwright
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from std_msgs.msg import String

from benchmarks.browser import COUNT, FLAGS, chromium
from intent_recognition.bags import BagReader
from intent_recognition.dashboard.cell import CellState
from intent_recognition.dashboard.commands import Commands
from intent_recognition.dashboard.page import DashboardPage
from intent_recognition.dashboard.scene_file import load_scene
from intent_recognition.dashboard.subscriptions import CellSubscriptions
from intent_recognition.dashboard.teaching_session import TeachingSession
from intent_recognition.dashboard.teleoperation import Teleoperation
from intent_recognition.dashboard.welcome import NEVER
from intent_recognition.demonstrations import iter_observations
from intent_recognition.model import load_model
from intent_recognition.nodes.conversions import message_class
from intent_recognition.nodes.intent_output import MarkerBuilder
from intent_recognition.promp import NONE
from intent_recognition.recognition import IntentEstimator
from sim_bridge.arm import find_robot

SIZE, PORT = (1120, 630), 8765
FRAMES_PER_S, N_COLOURS = 10, 200
FIRST_S, LAST_S, HOLD_FRAMES = -0.1, 5.0, 10
FADED_MS = 1500
SHOWN = "() => window.__viserMutable && window.__viserMutable.scene"
DRAWN = "() => new Promise(f => requestAnimationFrame(() => requestAnimationFrame(() => f(true))))"
WARNING = ".mantine-Notification-closeButton"
SCENARIO = "plate_handover,screw_handover,hold_screwdriver"


class Replayed:
    """The page, fed with a recorded session."""

    def __init__(self, bag: Path, model: Path, arm: str, scene: str):
        self.now_s = 0.0
        self._node = Node("moving_picture")
        self.state = CellState()
        before = set(self._node.subscriptions)
        CellSubscriptions(self._node, self.state, clock=lambda: self.now_s)
        made = [s for s in self._node.subscriptions if s not in before]
        self._take = {s.topic_name: s.callback for s in made}
        robot = find_robot(arm)
        self._take["/robot_description"](String(data=robot.description))
        loaded = load_model(model)
        self._estimator = IntentEstimator(loaded.library)
        self._observations = iter_observations(BagReader(bag), loaded.dofs)
        self._builder = MarkerBuilder((*loaded.library.labels, NONE))
        self._messages = BagReader(bag).raw_messages()
        self._next = next(self._messages)
        self.start_ns = self._next.log_time_ns
        self.onset_s = 1e-9 * (onset_ns(bag) - self.start_ns)
        self.page = self._page(scene, robot.tip)

    def _page(self, scene: str, hand_link: str) -> DashboardPage:
        commands = Commands(self._node, lambda ok, text: None)
        teleoperation = Teleoperation(self._node, self.state)
        rng = np.random.default_rng(0)
        session = TeachingSession(teleoperation, commands, rng)
        return DashboardPage(
            "127.0.0.1",
            PORT,
            self.state,
            commands,
            teleoperation,
            session,
            bags=(),
            models=lambda: (),
            play=None,
            stop=None,
            scene=load_scene(scene) if scene else None,
            hand_link=hand_link,
            light=NEVER,
            clock=lambda: self.now_s,
        )

    def go_to(self, now_s: float) -> None:
        """Let everything be received that was recorded until then, and show it."""
        end_ns = self.start_ns + round(now_s * 1e9)
        while self._next is not None and self._next.log_time_ns <= end_ns:
            self.now_s = (self._next.log_time_ns - self.start_ns) * 1e-9
            name = "/" + self._next.topic.lstrip("/")
            if name in self._take:
                kind = message_class(self._next.type)
                self._take[name](deserialize_message(self._next.data, kind))
            if name == "/mocap/wrist/pose":
                self._observe()
            self._next = next(self._messages, None)
        self.now_s = now_s
        self.page.update()

    def _observe(self) -> None:
        """Predict as the estimator did: its markers are not recorded."""
        observation = next(self._observations, None)
        if observation is None or self._estimator.reason_to_reject(observation) is not None:
            return
        estimate = self._estimator.update(observation)
        if not estimate.moving:
            return
        self._builder.observe(observation.stamp_ns, observation.values)
        human = self._estimator.predict_observed()
        if human is not None:
            path = human.trajectory
            markers = self._builder.build(
                estimate.stamp_ns, "world", human.task, 1.0, path.positions, path.std
            )
            self._take["/intent/markers"](markers)

    def close(self) -> None:
        """Stop serving."""
        self.page.close()
        self._node.destroy_node()


def onset_ns(bag: Path) -> int:
    """When the first reach of a recorded session begins."""
    messages = (m for m in BagReader(bag).messages() if m.topic.endswith("coworker/task"))
    return next(m.log_time_ns for m in messages if m.message.data)


@contextmanager
def browser(address: str) -> Iterator:
    """A page of playwright with the page open."""
    with sync_playwright() as driver:
        opened = driver.chromium.launch(executable_path=chromium(), args=list(FLAGS))
        page = opened.new_page(viewport={"width": SIZE[0], "height": SIZE[1]})
        page.set_default_timeout(120_000)
        page.goto(address)
        page.wait_for_function(SHOWN)
        page.locator(WARNING).first.click()  # of a browser without a graphics card
        yield page
        opened.close()


def picture(page) -> Image.Image:
    """The page once it has drawn what it was sent."""
    page.wait_for_timeout(40)
    while page.evaluate(COUNT)["waiting"]:
        page.wait_for_timeout(20)
    page.evaluate(DRAWN)
    return Image.open(BytesIO(page.screenshot())).convert("RGB")


def record(folder: Path, arm: str) -> tuple[Path, Path]:
    """Run the demo; returns its recording and its model."""
    command = [sys.executable, "-m", "intent_recognition.cli.main", "demo", "--headless"]
    command += ["--task-list", SCENARIO, "--rate", "1", "--arm", arm]
    command += ["--output", str(folder / "demo"), "--record", str(folder / "session")]
    subprocess.run(command, check=True)
    return folder / "session", folder / "demo" / "model.npz"


def main() -> None:
    """Make the moving picture, or single ones."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--arm", default="lwr")
    parser.add_argument("--bag", type=Path)
    parser.add_argument("--model", type=Path)
    parser.add_argument("--scene", default="toolbox")
    parser.add_argument("--first", type=float, default=FIRST_S, help="[s] after the first onset")
    parser.add_argument("--last", type=float, default=LAST_S)
    parser.add_argument("--at", type=float, nargs="+", help="single pictures, alike")
    parser.add_argument("--width", type=int, default=900, help="of the moving picture")
    parser.add_argument("--output", type=Path, default=Path(__file__).with_name("moving.gif"))
    args = parser.parse_args()
    os.environ.setdefault("AMENT_PREFIX_PATH", sys.prefix)
    with TemporaryDirectory() as folder:
        bag, model = (args.bag, args.model) if args.bag else record(Path(folder), args.arm)
        times = args.at or np.arange(args.first, args.last, 1.0 / FRAMES_PER_S).tolist()
        frames = take(bag, model, args.arm, args.scene, times, one_by_one=bool(args.at))
    if args.at:
        for at, frame in zip(args.at, frames, strict=True):
            frame.save(args.output.with_name(f"{args.output.stem}_{at:05.2f}.png"))
        return
    write(frames, args.width, args.output)


def take(bag, model, arm, scene, times, *, one_by_one) -> list[Image.Image]:
    """Pictures of the page at these times [s]."""
    rclpy.init()
    replayed = Replayed(bag, model, arm, scene)
    frames = []
    with browser(replayed.page.address) as page:
        step, now = 1.0 / 25.0, 0.0
        for at in (replayed.onset_s + time_s for time_s in times):
            while now + step < at:
                now += step
                replayed.go_to(now)
            replayed.go_to(at)
            if one_by_one:
                page.wait_for_timeout(FADED_MS)
            frames.append(picture(page))
            now = at
    replayed.close()
    rclpy.shutdown()
    return frames


def write(frames: list[Image.Image], width: int, output: Path) -> None:
    """One file of all frames, in colours that all of them share."""
    height = round(width * frames[0].height / frames[0].width)
    small = [frame.resize((width, height), Image.Resampling.LANCZOS) for frame in frames]
    some = small[:: max(1, len(small) // 8)]
    sheet = Image.new("RGB", (width, height * len(some)))
    for k, frame in enumerate(some):
        sheet.paste(frame, (0, k * height))
    palette = sheet.quantize(N_COLOURS, method=Image.Quantize.FASTOCTREE)
    indexed = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in small]
    indexed += [indexed[-1]] * HOLD_FRAMES
    indexed[0].save(
        output,
        save_all=True,
        append_images=indexed[1:],
        duration=round(1000 / FRAMES_PER_S),
        loop=0,
        optimize=True,
    )
    print(f"{len(indexed)} frames, {output.stat().st_size / 1e6:.1f} MB")


if __name__ == "__main__":
    main()
