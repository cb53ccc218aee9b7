# SPDX-License-Identifier: Apache-2.0
"""A headless Chromium on the page, driven as a person would drive it."""

import os
import socket
import time
from contextlib import contextmanager
from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from benchmarks import browser
from intent_recognition.dashboard.admission import answers

WIDTH, HEIGHT, PANEL = 1280, 800, 390
DEADLINE_S = browser.OPEN_S
TOKEN = "token-of-the-tests"
os.environ["INTENT_PAGE_TOKEN"] = TOKEN
FRAMES_HZ = 8.0
DRAG_STEPS, DRAG_STEP_MS = 12, 60
PIXEL = """([node, x, y, z]) => {
  const viewer = window.__viserMutable;
  const place = viewer.nodeRefFromName[node];
  if (!place) return null;
  place.updateWorldMatrix(true, false);
  const point = viewer.camera.position.clone().set(x, y, z);
  point.applyMatrix4(place.matrixWorld).project(viewer.camera);
  const frame = viewer.canvas.getBoundingClientRect();
  return [frame.left + (point.x + 1) / 2 * frame.width,
          frame.top + (1 - point.y) / 2 * frame.height];
}"""
"""Where a point of a thing in the scene is seen, by the page's own camera."""

BLIND = """(() => {
  const context = WebGL2RenderingContext.prototype;
  window.draws = false;
  for (const name of ["drawArrays", "drawElements", "drawArraysInstanced",
                      "drawElementsInstanced", "clear", "blitFramebuffer"]) {
    const draw = context[name];
    context[name] = function (...given) { if (window.draws) draw.apply(this, given); };
  }
})()"""
"""The scene is drawn only while somebody looks: by software a frame takes seconds of processor."""
LOOK = """async () => {
  window.draws = true;
  for (let k = 0; k < 3; k++) await new Promise(done => requestAnimationFrame(done));
  window.draws = false;
}"""
"""One whole frame is drawn between two frames of which parts may be missing."""


def chromium() -> None:
    """Without a browser the test is skipped, but not where CI runs."""
    if browser.chromium() is None:
        reason = "no chromium: sudo .ci/install_system_packages"
        if os.environ.get("CI"):
            pytest.fail(reason)
        pytest.skip(reason)


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


LOST = ".mantine-Loader-root"
"""The dots by which viser shows that it connects again. Until it has, it lets nothing be clicked: a
click meets the nameless `<div>` behind the tabs. It gives each attempt one second and then drops
it, so that on a busy machine none succeeds; the first one of a page has five."""


class Visitor:
    """Someone with the page open, who opens it anew when it has lost its connection."""

    def __init__(self, page):
        self.page = page
        page.add_locator_handler(page.locator(LOST), lambda: page.reload())
        self.requests: list[str] = []
        page.on("request", lambda request: self.requests.append(request.url))
        self.console: list[str] = []
        page.on("console", lambda message: self.console.append(message.text))

    def open(self, port: int) -> None:
        address = f"http://127.0.0.1:{port}/?token={TOKEN}"
        self.wait_until(lambda: answers(address), "the page is served")
        self.page.goto(address)
        self.wait_for("Watch")

    def text(self) -> str:
        return self.page.inner_text("body")

    def wait_for(self, text: str) -> None:
        self.wait_until(lambda: text in self.text(), text)

    def wait_until(self, condition, what: str) -> None:
        end = time.monotonic() + DEADLINE_S
        while not condition():
            if time.monotonic() > end:
                raise TimeoutError(f"not within {DEADLINE_S} s: {what}; page: {self.text()}")
            self.page.wait_for_timeout(100)

    def catches(self, text: str, within_s: float) -> bool:
        """Whether a text appears, if only for a moment; the page itself looks out for it."""
        from playwright.sync_api import TimeoutError as TooLate

        look = "text => document.body.innerText.replace(/\\s+/g, ' ').includes(text)"
        try:
            self.page.wait_for_function(look, arg=text, polling=50, timeout=1000 * within_s)
        except TooLate:
            return False
        return True

    def tab(self, name: str) -> None:
        self.page.get_by_role("tab", name=name).click()

    def press(self, name: str) -> None:
        button = self.page.get_by_role("button", name=name)
        self.wait_until(lambda: button.is_enabled(), f"{name} can be pressed")
        button.click()

    def pixel(self, node: str, point=(0.0, 0.0, 0.0)) -> np.ndarray | None:
        """Where a point (3,) [m] in the frame of a thing in the scene is seen (2,), in pixels."""
        found = self.page.evaluate(PIXEL, [node, *map(float, point)])
        return None if found is None else np.array(found)

    def drag(self, start: np.ndarray, end: np.ndarray) -> None:
        """Press, move and release the mouse, as a hand does: pixels (2,)."""
        mouse = self.page.mouse
        mouse.move(*start)
        self.page.wait_for_timeout(DRAG_STEP_MS)
        mouse.down()
        for share in np.linspace(0.0, 1.0, DRAG_STEPS):
            mouse.move(*(start + share * (end - start)))
            self.page.wait_for_timeout(DRAG_STEP_MS)
        mouse.up()

    def screenshot(self, **options) -> bytes:
        """What is seen, with the scene drawn for once."""
        self.page.evaluate(LOOK)
        return self.page.screenshot(**options)

    def scene(self) -> np.ndarray:
        """The three-dimensional part of the page as an image (H, W, 3)."""
        clip = {"x": 320, "y": 160, "width": WIDTH - PANEL - 320, "height": HEIGHT - 160}
        data = self.screenshot(clip=clip)
        return np.asarray(Image.open(BytesIO(data)).convert("RGB"), dtype=float)


@contextmanager
def visitor():
    """A visitor with a fresh profile."""
    chromium()
    with browser.fresh_page(WIDTH, HEIGHT) as (_, page):
        browser.calm(page, FRAMES_HZ)
        page.add_init_script(BLIND)
        person = Visitor(page)
        try:
            yield person
        finally:
            print(*person.console, sep="\n")  # pytest shows it if the test fails
