# SPDX-License-Identifier: Apache-2.0
"""The spread of people's timing is read back from warps that were drawn with it."""

import numpy as np
import pytest

from intent_recognition.alignment.rates import rate_spread
from intent_recognition.alignment.warp import Warp
from intent_recognition.errors import ArgumentError

SIZE = 60


def drawn(
    rng: np.random.Generator, n: int, std: float, correlation: float, mean: np.ndarray
) -> list[Warp]:
    """Warps with Ornstein-Uhlenbeck log rates about `mean`."""
    lag = np.abs(np.subtract.outer(np.arange(SIZE), np.arange(SIZE))) / SIZE
    root = np.linalg.cholesky(std**2 * np.exp(-lag / correlation) + 1e-12 * np.eye(SIZE))
    shifts = 0.03 * rng.normal(size=n)
    return [Warp(shift, mean + root @ rng.normal(size=SIZE)) for shift in shifts]


@pytest.mark.parametrize("correlation", [0.05, 0.1, 0.3])
def test_what_warps_were_drawn_with_is_read_back(rng, correlation):
    means = [np.zeros(SIZE), 0.5 * np.sin(np.arange(SIZE) / 9.0)]
    spread = rate_spread([drawn(rng, 400, 0.2, correlation, mean) for mean in means])
    assert spread.log_rate_std == pytest.approx(0.2, rel=0.1)
    assert spread.correlation == pytest.approx(correlation, rel=0.3)
    assert spread.start_std == pytest.approx(0.03, rel=0.15)
    assert spread.end_std > spread.start_std


def test_few_demonstrations_are_not_biased(rng):
    tasks = [drawn(rng, 3, 0.2, 0.1, np.zeros(SIZE)) for _ in range(200)]
    assert rate_spread(tasks).log_rate_std == pytest.approx(0.2, rel=0.1)


def test_demonstrations_in_step_have_no_spread():
    spread = rate_spread([[Warp.identity(61)] * 3])
    assert spread.log_rate_std == spread.start_std == spread.end_std == 0.0


@pytest.mark.parametrize(
    "tasks",
    [[], [[Warp.identity(61)]], [[Warp.identity(61)] * 2, [Warp.identity(41)] * 2]],
)
def test_what_tells_no_spread_is_refused(tasks):
    with pytest.raises(ArgumentError, match="two warps of one task"):
        rate_spread(tasks)
