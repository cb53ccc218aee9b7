# SPDX-License-Identifier: Apache-2.0
"""Run experiments in processes of their own and show how far they are."""

import time
from collections.abc import Collection, Mapping, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    wait,
)
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing import active_children, get_context
from multiprocessing.context import SpawnContext
from multiprocessing.process import BaseProcess
from queue import Empty, Queue

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from experiments.catalogue import Experiment
from experiments.results import ExperimentResult
from experiments.settings import Settings
from intent_recognition.errors import IntentError, one_line
from intent_recognition.interrupts import uninterrupted_children

News = Queue[tuple[str, float, str]]
"""Name of an experiment, share of it that is done, and what it does."""

LOOK_S = 0.2
"""Time between two looks at the news [s]."""
STOP_S = 5.0
"""Time from SIGTERM to an experiment until it is killed [s]."""
LEAST_STEP = 0.05
"""Share of an experiment between two lines where no terminal is."""


@dataclass(frozen=True)
class ExperimentRun:
    """One experiment that was run: its outcome, or the reason of its failure."""

    outcome: ExperimentResult | None
    failure: str
    seconds: float


def run_all(
    entries: Sequence[Experiment], settings: Settings, jobs: int, console: Console
) -> dict[str, ExperimentRun]:
    """Run each in a fresh process, `jobs` at a time, and show how far; results in their order."""
    context = get_context("spawn")
    show = _ProgressBars if console.is_terminal else _ProgressLines
    with uninterrupted_children():
        news_manager = context.Manager()
    with (
        news_manager as manager,
        show(console, [entry.name for entry in entries]) as shown,
        ThreadPoolExecutor(jobs) as pool,
    ):
        news, others = manager.Queue(), active_children()
        futures: dict[str, Future] = {}
        try:
            for entry in entries:
                futures[entry.name] = pool.submit(_alone, context, entry, settings, news)
            _watch(futures, news, shown)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            _end(futures.values(), others)
            raise
        return {name: _result(future) for name, future in futures.items()}


class _ProgressBars(Progress):
    """A bar for each experiment."""

    def __init__(self, console: Console, names: Sequence[str]):
        columns = (
            TextColumn("{task.fields[name]:>12}"),
            BarColumn(),
            TimeElapsedColumn(),
            TextColumn("{task.description}"),
        )
        super().__init__(*columns, console=console)
        self._rows = {
            name: self.add_task("waiting", total=1.0, name=name, start=False) for name in names
        }

    def show(self, name: str, share: float, what: str) -> None:
        """Show the share of an experiment that is done, and what it does."""
        self.start_task(self._rows[name])
        self.update(self._rows[name], completed=share, description=what)

    def end(self, name: str, how: str) -> None:
        """Show that an experiment is over."""
        self.update(self._rows[name], completed=1.0, description=how)
        self.stop_task(self._rows[name])


class _ProgressLines(AbstractContextManager):
    """Without a terminal: a plain line for each step of an experiment of at least `LEAST_STEP`."""

    def __init__(self, console: Console, names: Sequence[str]):
        self._console, self._shown = console, dict.fromkeys(names, -1.0)
        self._started = time.monotonic()

    def __exit__(self, *_: object) -> None:
        pass

    def show(self, name: str, share: float, what: str) -> None:
        """Show the share of an experiment that is done, and what it does."""
        if share - self._shown[name] >= LEAST_STEP:
            self._shown[name] = share
            self._print(name, f"{100 * share:3.0f} %  {what}")

    def end(self, name: str, how: str) -> None:
        """Show that an experiment is over."""
        self._print(name, how)

    def _print(self, name: str, text: str) -> None:
        elapsed_s = time.monotonic() - self._started
        line = f"{elapsed_s:6.0f} s  {name:>12}  {text}"
        self._console.print(line, markup=False)


def _end(futures: Collection[Future], others: Collection[BaseProcess]) -> None:
    """End the processes of experiments, also one that is just being started."""
    patience_s = time.monotonic() + STOP_S
    while not all(future.done() for future in futures):
        for process in active_children():
            if process not in others:  # some inherit that SIGTERM is ignored
                process.terminate() if time.monotonic() < patience_s else process.kill()
        wait(futures, LOOK_S)


def _result(future: Future) -> ExperimentRun:
    error = future.exception()
    if error is None:
        return future.result()
    kind = "" if isinstance(error, IntentError) else f"{type(error).__name__}: "
    return ExperimentRun(None, kind + one_line(error), 0.0)


def _watch(
    futures: Mapping[str, Future], news: News, shown: "_ProgressBars | _ProgressLines"
) -> None:
    """Show the news of all experiments until the last one is over."""
    running = dict(futures)
    while running:
        wait(running.values(), LOOK_S, FIRST_COMPLETED)
        over = [name for name, future in running.items() if future.done()]
        _show(news, shown)
        for name in over:
            shown.end(name, "broke off" if running.pop(name).exception() else "done")


def _show(news: News, shown: "_ProgressBars | _ProgressLines") -> None:
    while True:
        try:
            name, share, what = news.get_nowait()
        except Empty:
            return
        shown.show(name, share, what)


def _alone(
    context: SpawnContext, entry: Experiment, settings: Settings, news: News
) -> ExperimentRun:
    """One experiment in a process of its own, so that its end ends no other."""
    with ProcessPoolExecutor(1, mp_context=context) as process:
        with uninterrupted_children():
            future = process.submit(_run, entry, settings, news)
        return future.result()


def _run(entry: Experiment, settings: Settings, news: News) -> ExperimentRun:
    """One experiment, in its process."""
    started = time.monotonic()
    news.put((entry.name, 0.0, "starting"))
    watched = replace(settings, progress=partial(_report, news, entry.name))
    return ExperimentRun(entry.run(watched), "", time.monotonic() - started)


def _report(news: News, name: str, share: float, what: str) -> None:
    news.put((name, share, what))
