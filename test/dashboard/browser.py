# SPDX-License-Identifier: Apache-2.0
"""A headless Chromium on the page, driven as a person would drive it."""

import os
import shutil
import socket
import time
import urllib.request
from contextlib import contextmanager
from io import BytesIO

import numpy as np
import pytest
from PIL import Image

WIDTH, HEIGHT, PANEL = 1280, 800, 390
DEADLINE_S = 120.0
FLAGS = (
    "--no-sandbox",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--enable-unsafe-swiftshader",
)


def chromium() -> str:
    """Path of the browser; without one the test is skipped, but not where CI runs."""
    path = shutil.which("chromium") or shutil.which("chromium-browser")
    if path is None:
        reason = "no chromium: sudo .ci/install_system_packages"
        if os.environ.get("CI"):
            pytest.fail(reason)
        pytest.skip(reason)
    return path


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def _served(port: int) -> bool:
    try:
        with urllib.request.urlopen(f"http://127.0.0.1:{port}", timeout=DEADLINE_S) as answer:
            return answer.status == 200
    except OSError:
        return False


class Visitor:
    """Someone with the page open."""

    def __init__(self, page):
        self.page = page
        page.set_default_timeout(1000 * DEADLINE_S)
        self.requests: list[str] = []
        page.on("request", lambda request: self.requests.append(request.url))

    def open(self, port: int) -> None:
        self.wait_until(lambda: _served(port), "the page is served")
        self.page.goto(f"http://127.0.0.1:{port}")
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

    def scene(self) -> np.ndarray:
        """The three-dimensional part of the page as an image (H, W, 3)."""
        clip = {"x": 320, "y": 160, "width": WIDTH - PANEL - 320, "height": HEIGHT - 160}
        data = self.page.screenshot(clip=clip)
        return np.asarray(Image.open(BytesIO(data)).convert("RGB"), dtype=float)


@contextmanager
def visitor():
    """A visitor with a fresh profile."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=chromium(), args=list(FLAGS))
        try:
            yield Visitor(browser.new_page(viewport={"width": WIDTH, "height": HEIGHT}))
        finally:
            browser.close()
