# SPDX-License-Identifier: Apache-2.0
"""A million observations with hardly any noise: does the covariance stay one?"""

from collections.abc import Iterator

import numpy as np

from benchmarks.measure import Result
from benchmarks.synthetic import N_BASIS, N_OBSERVED, synthetic_library
from intent_recognition.promp.filter_block import FilterBlock, make_state

N_UPDATES = 1_000_000
NOISE_VARIANCE = 1e-8
LOOK_EVERY = 10_000


def numerics(n_updates: int = N_UPDATES) -> Iterator[Result]:
    """The smallest eigenvalue ever, and the distance to the information form at the end.

    Two priors are conditioned: one on phases at random, one on a hand that rests at phase 0.37.
    """
    rng = np.random.default_rng(7)
    library = synthetic_library(rng, 1, n_controlled=0)
    prior = library.observed_covariance[[1, 1]]
    block = FilterBlock(make_state(np.zeros(prior.shape[:2]), prior, N_BASIS), N_BASIS)
    noise, dofs, values = NOISE_VARIANCE * np.eye(N_OBSERVED), np.arange(N_OBSERVED), np.zeros(3)
    gram = np.zeros((N_BASIS, N_BASIS))
    smallest, asymmetry = np.inf, 0.0
    for start in range(0, n_updates, LOOK_EVERY):
        phase = np.full((LOOK_EVERY, 2), 0.37)
        phase[:, 0] = rng.uniform(size=LOOK_EVERY)
        rows = library.basis.design_matrix(phase[: n_updates - start])
        gram += rows[:, 0].T @ rows[:, 0]
        for row in rows[:, :, None]:
            block.condition(dofs, row, values, noise)
        block.fold()
        covariance = block.covariance
        asymmetry = max(asymmetry, np.abs(covariance - covariance.transpose(0, 2, 1)).max())
        smallest = min(smallest, np.linalg.eigvalsh(covariance).min())
    yield Result(
        f"{n_updates:.0e} observations, smallest eigenvalue",
        smallest,
        np.finfo(float).tiny,
        "at least",
        "m2",
        f"noise variance {NOISE_VARIANCE:.0e}; asymmetry {asymmetry:g}",
    )
    information = np.linalg.inv(prior[0]) + np.kron(np.eye(N_OBSERVED), gram) / NOISE_VARIANCE
    error = np.abs(block.covariance[0] - np.linalg.inv(information)).max() / np.abs(prior[0]).max()
    yield Result(
        "... covariance off the batch's, of the prior's",
        error,
        1e-9,
        "at most",
        "x",
        "largest element",
    )
