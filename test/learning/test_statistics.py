# SPDX-License-Identifier: Apache-2.0
"""Statistics of tasks: the same however the demonstrations are grouped and ordered."""

from functools import reduce

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from intent_recognition.errors import ShapeError
from intent_recognition.learning import TaskStatistics, TrainingExample, statistics
from intent_recognition.learning.statistics import merge_statistics, pooled_moments, summarize

seeds = st.integers(0, 2**32 - 1)
D, N = 3, 4


def make_examples(rng: np.random.Generator, n: int, offset: float = 0.0) -> list[TrainingExample]:
    examples = unaligned(rng, n, offset)
    over_reference = unaligned(rng, n, offset)
    return [
        example._replace(aligned=other._replace(name=example.name, duration_s=example.duration_s))
        for example, other in zip(examples, over_reference, strict=True)
    ]


def unaligned(rng: np.random.Generator, n: int, offset: float) -> list[TrainingExample]:
    return [
        TrainingExample(
            f"demo_{rng.integers(10**9)}",
            "task",
            offset + rng.normal(size=(D, N)),
            rng.uniform(0.1, 1.0, size=D),
            float(rng.uniform(0.5, 3.0)),
            rng.normal(size=(5, 2)),
            rng.normal(size=(6, 1)),
        )
        for _ in range(n)
    ]


def assert_same(found: TaskStatistics, expected: TaskStatistics, rtol: float = 1e-9) -> None:
    for name, value in vars(expected).items():
        if name == "aligned":
            assert (found.aligned is None) == (value is None)
            if value is not None:
                assert_same(found.aligned, value, rtol)
        elif name != "examples":
            np.testing.assert_allclose(getattr(found, name), value, rtol=rtol, atol=1e-12)
    assert [e.name for e in found.examples] == [e.name for e in expected.examples]


@given(seeds, st.integers(1, 12), st.floats(-1e3, 1e3))
def test_statistics_are_the_moments(seed, n, offset):
    examples = make_examples(np.random.default_rng(seed), n, offset)
    found = summarize(examples)
    weights = np.array([e.weights for e in examples])
    logs = np.log([e.duration_s for e in examples])
    assert found.n == n and found.moments.freedom == n - 1
    np.testing.assert_allclose(found.mean, weights.mean(axis=0), rtol=1e-12)
    expected = (n - 1) * np.cov(weights.reshape(n, -1).T) if n > 1 else np.zeros((D * N, D * N))
    np.testing.assert_allclose(found.scatter, expected, atol=1e-8)
    np.testing.assert_array_equal(found.lowest, weights.transpose(1, 0, 2).min(axis=(1, 2)))
    np.testing.assert_array_equal(found.highest, weights.transpose(1, 0, 2).max(axis=(1, 2)))
    np.testing.assert_allclose(found.log_duration_scatter, n * np.var(logs), atol=1e-12)
    assert found.duration_sum_s == pytest.approx(sum(e.duration_s for e in examples))


@given(seeds, st.lists(st.integers(1, 6), min_size=2, max_size=5))
def test_merged_parts_are_the_whole(seed, sizes):
    rng = np.random.default_rng(seed)
    groups = [make_examples(rng, size) for size in sizes]
    whole = summarize([example for group in groups for example in group])
    assert_same(reduce(merge_statistics, map(summarize, groups)), whole)


def test_statistics_keep_digits_and_are_pooled_about_the_means(rng):
    """Sums of squares would lose them all: 1e8 squared is 1e16."""
    examples = make_examples(rng, 200, offset=1e8)
    weights = np.array([e.weights - 1e8 for e in examples]).reshape(200, -1)
    found = reduce(merge_statistics, (summarize([e]) for e in examples))
    np.testing.assert_allclose(found.scatter, 199 * np.cov(weights.T), rtol=1e-5, atol=1e-4)
    assert np.linalg.eigvalsh(found.scatter).min() > 0
    tasks = [summarize(make_examples(rng, n, offset)) for n, offset in ((3, 0.0), (1, 9.0), (5, 5))]
    pooled = pooled_moments(tasks)
    assert pooled.freedom == 2 + 0 + 4
    np.testing.assert_allclose(pooled.matrix, sum(task.scatter for task in tasks))
    with pytest.raises(ShapeError, match="one or more demonstrations"):
        summarize([])


def test_the_examples_kept_do_not_depend_on_order_or_grouping(rng, monkeypatch):
    monkeypatch.setattr(statistics, "MAX_EXAMPLES", 7)
    examples = make_examples(rng, 40)
    kept = [e.name for e in summarize(examples).examples]
    assert len(kept) == 7
    for _ in range(5):
        shuffled = [examples[i] for i in rng.permutation(40)]
        cuts = np.sort(rng.choice(np.arange(1, 40), size=4, replace=False))
        groups = np.split(np.arange(40), cuts)
        parts = [summarize([shuffled[i] for i in group]) for group in groups]
        assert [e.name for e in reduce(merge_statistics, parts).examples] == kept


def test_the_examples_kept_are_a_fair_sample(monkeypatch):
    """Names that are numbers in a row: every tenth of them is drawn alike."""
    monkeypatch.setattr(statistics, "MAX_EXAMPLES", 500)
    (one,) = make_examples(np.random.default_rng(0), 1)
    named = [one._replace(name=f"demo_{k:05d}") for k in range(5000)]
    kept = [int(e.name[5:]) for e in summarize(named).examples]
    counts, _ = np.histogram(kept, bins=10, range=(0, 5000))
    assert np.sum((counts - 50) ** 2 / 50) < 27.9  # chi-square of 9 degrees at 0.999
