# SPDX-License-Identifier: Apache-2.0
"""Run experiments in processes of their own and show how far they are."""

import time
from collections.abc import Sequence
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures import TimeoutError as NotYet
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing import get_context
from queue import Empty

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from intent_recognition.errors import IntentError
from intent_recognition.experiments.catalogue import Entry
from intent_recognition.experiments.outcome import Outcome, Settings

LOOK_S = 0.2


@dataclass(frozen=True)
class Run:
    """What became of one experiment: its outcome, or why it broke off."""

    outcome: Outcome | None
    failure: str
    seconds: float


def run_all(
    entries: Sequence[Entry], settings: Settings, jobs: int, console: Console
) -> dict[str, Run]:
    """Run each in a fresh process, `jobs` at a time, with a bar each; results in their order."""
    context = get_context("spawn")
    columns = (
        TextColumn("{task.fields[name]:>12}"),
        BarColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.description}"),
    )
    with (
        context.Manager() as manager,
        Progress(*columns, console=console) as bars,
        ThreadPoolExecutor(jobs) as pool,
    ):
        news = manager.Queue()
        rows = {
            entry.name: bars.add_task("waiting", total=1.0, name=entry.name, start=False)
            for entry in entries
        }
        futures = {
            entry.name: pool.submit(_alone, context, entry, settings, news) for entry in entries
        }
        try:
            for name, future in futures.items():
                _watch(future, news, rows, bars)
                done = "broke off" if future.exception() else "done"
                bars.update(rows[name], completed=1.0, description=done)
                bars.stop_task(rows[name])
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
        return {name: _result(future) for name, future in futures.items()}


def _result(future: Future) -> Run:
    error = future.exception()
    if error is None:
        return future.result()
    kind = "" if isinstance(error, IntentError) else f"{type(error).__name__}: "
    return Run(None, kind + " ".join(str(error).split()), 0.0)


def _watch(future: Future, news, rows: dict, bars: Progress) -> None:
    """Show the news of all experiments until this one is over."""
    while not future.done():
        _show(news, rows, bars)
        try:
            future.exception(timeout=LOOK_S)
        except NotYet:
            continue
    _show(news, rows, bars)


def _show(news, rows: dict, bars: Progress) -> None:
    while True:
        try:
            name, share, what = news.get_nowait()
        except Empty:
            return
        bars.start_task(rows[name])
        bars.update(rows[name], completed=share, description=what)


def _alone(context, entry: Entry, settings: Settings, news) -> Run:
    """One experiment in a process of its own; what ends that ends no other."""
    with ProcessPoolExecutor(1, mp_context=context) as process:
        return process.submit(_run, entry, settings, news).result()


def _run(entry: Entry, settings: Settings, news) -> Run:
    """One experiment, in its process."""
    started = time.monotonic()
    news.put((entry.name, 0.0, "starting"))
    watched = replace(settings, progress=partial(_tell, news, entry.name))
    return Run(entry.run(watched), "", time.monotonic() - started)


def _tell(news, name: str, share: float, what: str) -> None:
    news.put((name, share, what))
