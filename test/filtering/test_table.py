# SPDX-License-Identifier: Apache-2.0
"""The table of hypotheses: rows come and go, and each keeps what is its own."""

import numpy as np
from simulation import START_NS, make_library

from intent_recognition.filtering.observation_model import ObservationModel
from intent_recognition.filtering.table import OFFSET_BASIS, HypothesisTable
from intent_recognition.gaussian.batch import GaussianBatch, state_width
from intent_recognition.signals.observation import Observation


def table_of(library, n: int, settling: int = 0) -> HypothesisTable:
    table, n_basis = HypothesisTable(8, library, settling), library.basis.n_basis
    prior = library.observed_mean[:1], library.observed_covariance[:1]
    batch = GaussianBatch.of(*prior, n_basis)
    if settling:
        batch = batch.resized([0], n_basis + OFFSET_BASIS, np.ones((1, 3, OFFSET_BASIS)))
    state = np.repeat(batch.state, n, axis=0)
    table.add(
        state, kind=np.arange(n), rate=4.0, duration_s=1.5 + 0.1 * np.arange(n), log_prior=0.0
    )
    return table


def test_rows_keep_their_own_whatever_is_dropped_and_added(rng):
    library = make_library(rng, n_basis=5)
    model = ObservationModel(library, START_NS)
    seen = [
        model.measurement(Observation(START_NS + round(t * 1e9), 0, rng.normal(size=3)))
        for t in (0.1, 0.5, 0.9)
    ]
    whole, few = table_of(library, 6), table_of(library, 6)
    for one in seen[:2]:
        whole.condition(one)
        few.condition(one)
    few.drop(np.isin(few.rows["kind"], [0, 3, 4]))
    new = few.add(np.zeros((2, state_width(3 * 5))), kind=9, duration_s=1.0)
    assert not few.rows["seen"][new].any() and few.n == 5
    few.drop(few.rows["kind"] == 9)
    whole.condition(seen[2])
    few.condition(seen[2])
    assert sorted(few.rows["kind"]) == [1, 2, 5]
    same = few.rows["kind"]
    ours, theirs = few.courses(np.arange(3)), whole.courses(same)
    np.testing.assert_allclose(ours.state, theirs.state, atol=1e-12)
    np.testing.assert_allclose(few.log_joint, whole.log_joint[same], atol=1e-12)


def test_a_row_that_lags_catches_up_and_is_judged_once_it_has_settled(rng):
    library = make_library(rng, n_basis=5)
    model = ObservationModel(library, START_NS)
    table, other = table_of(library, 2, settling=1), table_of(library, 2, settling=1)
    for k, t in enumerate((0.1, 0.4, 0.8)):
        one = model.measurement(Observation(START_NS + round(t * 1e9), 0, rng.normal(size=3)))
        other.condition(one)
        table.condition(one, np.array([0]))
        assert np.all(other.rows["log_evidence"] != 0.0) == (k > 0)
        table.condition(one, np.array([1]))
    np.testing.assert_array_equal(table.rows["seen"], 3)
    np.testing.assert_allclose(table.log_joint, other.log_joint, rtol=1e-12)
