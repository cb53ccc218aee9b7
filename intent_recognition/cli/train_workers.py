# SPDX-License-Identifier: Apache-2.0
"""Runs work in this process, in other processes on this machine, or on a dask scheduler."""

import argparse
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError, Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, contextmanager, nullcontext
from functools import partial
from multiprocessing import get_context
from typing import Any

from intent_recognition.cli.options import add_options, number
from intent_recognition.errors import IntentError, ResourceBusyError, optional
from intent_recognition.interrupts import uninterrupted_children
from intent_recognition.model import Run

AHEAD = 3
"""Pieces of work in progress per worker: none waits for work, and results do not pile up."""
CONNECT_S = 10.0
"""Longest wait for a dask scheduler [s]."""


def add_worker_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of commands whose work can be distributed."""
    add_options(
        parser,
        """
        where bags are read, one of:
        --jobs N             processes that read the bags (default: %(default)s)
        --scheduler ADDRESS  dask scheduler whose workers read the bags, as tcp://127.0.0.1:8786;
                             they need the same paths and `pip install .[dask]`
        """,
        jobs={"type": number(int, 1), "default": 1},
    )


def workers(jobs: int = 1, scheduler: str | None = None) -> AbstractContextManager[Run]:
    """A `map` over `jobs` processes, or over the workers of a dask scheduler.

    Args:
        jobs: number of processes; 1 works in this process.
        scheduler: address such as `tcp://127.0.0.1:8786`; its workers must see the same paths.
    """
    if scheduler is not None:
        return _dask(scheduler)
    return _processes(jobs) if jobs > 1 else nullcontext(map)


@contextmanager
def _processes(jobs: int) -> Iterator[Run]:
    # Spawn fresh interpreters: forking a process with a progress bar's thread may deadlock.
    pool = ProcessPoolExecutor(jobs, get_context("spawn"))

    def submit(*work: Any) -> Future:
        with uninterrupted_children():
            return pool.submit(*work)

    try:
        yield partial(_in_order, submit, AHEAD * jobs)
    except BrokenProcessPool as error:
        cure = "Try fewer of them."
        raise IntentError.about("--jobs", "processes that run to their end", error, cure) from error
    finally:
        pool.shutdown(cancel_futures=True)


@contextmanager
def _dask(scheduler: str) -> Iterator[Run]:
    distributed = optional("distributed")
    from distributed.comm import CommClosedError

    try:
        client = distributed.Client(scheduler, timeout=CONNECT_S, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        expected = "the address of a running dask scheduler, as tcp://127.0.0.1:8786"
        cure = "Start one with `dask scheduler`, or use --jobs."
        raise ResourceBusyError.about(f"--scheduler {scheduler}", expected, error, cure) from error
    with client:
        n_workers = len(client.scheduler_info(n_workers=-1)["workers"])
        if not n_workers:
            expected = "at least one worker"
            cure = f"Start some with `dask worker {scheduler}`."
            raise ResourceBusyError.about(f"--scheduler {scheduler}", expected, "none", cure)
        try:
            yield partial(_in_order, partial(client.submit, pure=False), AHEAD * n_workers)
        except (distributed.KilledWorker, CommClosedError, CancelledError) as error:
            expected = "scheduler and workers that run to the end"
            got = f"{type(error).__name__}: {error}"
            cure = "Look at their logs, or use --jobs."
            raise IntentError.about(f"--scheduler {scheduler}", expected, got, cure) from error


def _in_order(submit: Callable, ahead: int, function: Callable, items: Iterable) -> Iterator:
    """Results in the order of the items, with at most `ahead` in progress."""
    pending: deque[Any] = deque()
    for item in items:
        pending.append(submit(function, item))
        if len(pending) >= ahead:
            yield pending.popleft().result()
    while pending:
        yield pending.popleft().result()
