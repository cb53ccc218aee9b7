# SPDX-License-Identifier: Apache-2.0
"""Recordings simulated again from other seeds: how much of a result is chance."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np

from experiments.settings import Settings
from intent_recognition.array_types import Floats
from intent_recognition.report import Column, TableBlock

Numbers = Mapping[str, float]
"""Results of one draw by name; all draws have the same names."""


class Draw(NamedTuple):
    """Results from the recordings of one seed."""

    seed: int
    numbers: Numbers


def draw_again(
    settings: Settings,
    scenario: str,
    evaluate: Callable[[Path], Numbers],
    *,
    keep: Callable[[PurePosixPath], bool] = lambda folder: True,
    progress: Callable[[float], None] = lambda share: None,
) -> list[Draw]:
    """Make the recordings of a scenario from each seed but the first, and evaluate each folder.

    `keep` chooses the recordings that are needed by their folder.
    """
    from experiments.generate import record

    draws = []
    for k in range(1, settings.n_seeds):
        seed = settings.seed + k
        with TemporaryDirectory() as folder:
            record(Path(folder), seed, scenario, keep)
            draws.append(Draw(seed, evaluate(Path(folder))))
        progress(k / (settings.n_seeds - 1))
    return draws


def spread(values: Sequence[float] | Floats, digits: int = 1) -> str:
    """Text with median and range of some values."""
    drawn = np.asarray(values, dtype=np.float64)
    middle, low, high = (f"{f(drawn):.{digits}f}" for f in (np.median, np.min, np.max))
    return f"{middle} ({low} to {high})"


def drawn(draws: Sequence[Draw], name: str) -> Floats:
    """One number of all draws, (n,)."""
    return np.array([draw.numbers[name] for draw in draws])


def also(draws: Sequence[Draw], name: str, digits: int = 1) -> str:
    """Text with median and range over all draws, to follow the shipped one's number."""
    if len(draws) < 2:
        return ""
    return f"; {len(draws)} draws {spread(drawn(draws, name), digits)}"


def for_json(draws: Sequence[Draw]) -> list[dict[str, float]]:
    """Seed and numbers of each draw."""
    return [{"seed": draw.seed, **draw.numbers} for draw in draws]


def draws_tables(
    draws: Sequence[Draw], unit: Callable[[str], str], caption: str
) -> tuple[TableBlock, ...]:
    """A row for each draw, the shipped one first, and one for median and range.

    There is no table of the shipped draw alone. `unit` is called with the name of a number.
    """
    if len(draws) < 2:
        return ()
    table = {name: drawn(draws, name) for name in draws[0].numbers}
    digits = {name: 0 if np.all(values % 1 == 0) else 1 for name, values in table.items()}
    columns = [Column(name, unit(name), form=f".{digits[name]}f") for name in table]
    rows = [(draw.seed, *(draw.numbers[name] for name in table)) for draw in draws]
    last = ("all", *(spread(table[name], digits[name]) for name in table))
    return (TableBlock([Column("seed"), *columns], [*rows, last], caption, strong=[len(draws)]),)
