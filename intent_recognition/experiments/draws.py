# SPDX-License-Identifier: Apache-2.0
"""Recordings drawn again from other seeds: how much the shipped ones leave to chance."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from intent_recognition.experiments.settings import Settings
from intent_recognition.report import Column, Table

Numbers = Mapping[str, float]
"""What one draw is told by: numbers by name, the same in all draws."""


class Draw(NamedTuple):
    """What came out of the recordings of one seed."""

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
    """Make the recordings of a scenario from each seed but the first, and evaluate them.

    Args:
        settings: `n_seeds` draws in all, the shipped recordings being the first.
        scenario: name of its recordings, as `sim_bridge.scenarios.generate` knows it.
        evaluate: called with the folder in which the scenario's folder lies.
        keep: which recordings are needed, by their folder.
        progress: called with the share done, 0 to 1.
    """
    from sim_bridge.scenarios.generate import record

    draws = []
    for k in range(1, settings.n_seeds):
        seed = settings.seed + k
        with TemporaryDirectory() as folder:
            record(Path(folder), seed, scenario, keep)
            draws.append(Draw(seed, evaluate(Path(folder))))
        progress(k / (settings.n_seeds - 1))
    return draws


def spread(values: Sequence[float] | NDArray[np.float64], digits: int = 1) -> str:
    """Median and range of some draws."""
    drawn = np.asarray(values, dtype=np.float64)
    middle, low, high = (f"{f(drawn):.{digits}f}" for f in (np.median, np.min, np.max))
    return f"{middle} ({low} to {high})"


def draws_table(draws: Sequence[Draw], units: Mapping[str, str], caption: str) -> Table:
    """A row for each draw, and one for median and range.

    Args:
        draws: the shipped one first.
        units: of the columns, "" for none; the names are those of the numbers.
        caption: of the table.
    """
    columns = (Column("seed"), *(Column(name, unit) for name, unit in units.items()))
    table = {name: np.array([draw.numbers[name] for draw in draws]) for name in units}
    digits = {name: 0 if np.all(values % 1 == 0) else 1 for name, values in table.items()}
    rows = [
        (str(draw.seed), *(f"{draw.numbers[name]:.{digits[name]}f}" for name in units))
        for draw in draws
    ]
    last = ("all", *(spread(table[name], digits[name]) for name in units))
    return Table(columns, (*rows, last), caption=caption, strong=frozenset({len(rows)}))
