# SPDX-License-Identifier: Apache-2.0
"""A headless Chromium with the page open, and what can be measured of it."""

import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

FLAGS = (
    "--no-sandbox",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--enable-unsafe-swiftshader",
)
CALM = """(() => {
  const draw = window.requestAnimationFrame.bind(window), period = 1000 / RATE;
  const asked = new Set();
  let last = 0;
  window.requestAnimationFrame = callback => {
    const id = setTimeout(() => {
      last = performance.now();
      draw(time => { if (asked.delete(id)) callback(time); });
    }, Math.max(0, last + period - performance.now()));
    asked.add(id);
    return id;
  };
  window.cancelAnimationFrame = id => { asked.delete(id); clearTimeout(id); };
})()"""
"""Fewer frames are drawn. One that is taken back never runs, not even when its time has come."""
NAMES = ("chromium", "chromium-browser", "google-chrome")
OPEN_S = 120.0
FRAMES_HZ = 25.0
KILOBYTE, MEGABYTE = 1024, 2**20
COUNT = """() => {
  const viewer = window.__viserMutable;
  const memory = window.__viserTestpoints.rendererInfo.memory;
  let objects = 0;
  viewer.scene.traverse(() => { objects += 1; });
  return {objects, geometries: memory.geometries, textures: memory.textures,
          waiting: viewer.messageQueue.length};
}"""
"""viser keeps scene, renderer and queue of messages there for its own tests."""
SEEN = "name => window.__viserMutable && window.__viserMutable.nodeRefFromName[name]"
FRAME = """async () => {
  for (let k = 0; k < 2; k++) await new Promise(done => requestAnimationFrame(done));
  const gl = window.__viserMutable.canvas.getContext("webgl2");
  gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
}"""
"""The frame that was begun is drawn to its end before a pixel of it can be read."""


class PageSize(NamedTuple):
    """What the open page holds, after its garbage was collected.

    Attributes:
        heap_mb: objects of its JavaScript.
        renderer_mb: memory of its process, with what the collector keeps for later.
        elements: nodes of the document.
        listeners: event listeners.
        objects: of the scene.
        geometries, textures: kept by the graphics processor.
        waiting: messages that came and were not handled yet.
    """

    heap_mb: float
    renderer_mb: float
    elements: int
    listeners: int
    objects: int
    geometries: int
    textures: int
    waiting: int


class OpenPage:
    """The page, as a headless Chromium shows it.

    Args:
        browser: that shows it.
        page: one of its tabs.
    """

    def __init__(self, browser: "Browser", page: "Page"):
        self._page = page
        self._session = page.context.new_cdp_session(page)
        processes = browser.new_browser_cdp_session().send("SystemInfo.getProcessInfo")
        renderers = [p["id"] for p in processes["processInfo"] if p["type"] == "renderer"]
        self._renderer = max(renderers, key=resident_mb)

    def size(self) -> PageSize:
        """Collect garbage, then look."""
        self._session.send("HeapProfiler.collectGarbage")
        heap = self._session.send("Runtime.getHeapUsage")
        document = self._session.send("Memory.getDOMCounters")
        return PageSize(
            heap_mb=heap["usedSize"] / MEGABYTE,
            renderer_mb=resident_mb(self._renderer),
            elements=document["nodes"],
            listeners=document["jsEventListeners"],
            **self._page.evaluate(COUNT),
        )

    def wait(self, seconds: float) -> None:
        """Let it go on."""
        self._page.wait_for_timeout(1e3 * seconds)


def calm(page: "Page", frames_hz: float) -> None:
    """Let a page draw so often, before it is opened: by itself it takes what the processor has."""
    page.add_init_script(CALM.replace("RATE", str(frames_hz)))


def chromium() -> str | None:
    """Path of the browser, None without one."""
    return next((found for name in NAMES if (found := shutil.which(name))), None)


@contextmanager
def open_page(url: str, width: int, height: int) -> Iterator[OpenPage]:
    """A browser with a fresh profile, and the page open in it."""
    with fresh_page(width, height) as (browser, page):
        calm(page, FRAMES_HZ)
        page.goto(url)
        page.wait_for_function("() => window.__viserMutable && window.__viserMutable.scene")
        yield OpenPage(browser, page)


def first_sight_s(url: str, width: int, height: int, node: str) -> float:
    """Time from the address to the first whole frame that has a node of the scene [s]."""
    with fresh_page(width, height) as (_, page):
        started_s = time.monotonic()
        page.goto(url)
        page.wait_for_function(SEEN, arg=node)
        page.evaluate(FRAME)
        return time.monotonic() - started_s


@contextmanager
def fresh_page(width: int, height: int) -> Iterator[tuple["Browser", "Page"]]:
    """A browser with a fresh profile, and one empty page."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=chromium(), args=list(FLAGS))
        try:
            page = browser.new_page(viewport={"width": width, "height": height})
            page.set_default_timeout(1e3 * OPEN_S)
            yield browser, page
        finally:
            browser.close()


def resident_mb(process: int) -> float:
    """Memory of a process that is in use, on Linux."""
    for line in Path(f"/proc/{process}/status").read_text(encoding="utf-8").splitlines():
        if line.startswith("VmRSS:"):
            return int(line.split()[1]) / KILOBYTE
    return float("nan")
