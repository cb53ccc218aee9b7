# SPDX-License-Identifier: Apache-2.0
"""Which recordings each protocol trains and tests on."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from intent_recognition.errors import ArgumentError
from intent_recognition.evaluation import make_folds
from intent_recognition.evaluation.folds import merge_folds
from intent_recognition.signals import Demonstration


def recorded(name: str, task: str, **metadata: str) -> Demonstration:
    return Demonstration(name, "", task, (), (), 0, 1, metadata)


PEOPLE = [
    recorded("d3", "a", person="ann"),
    recorded("d1", "a", person="bob"),
    recorded("d2", "b", person="bob"),
    recorded("d4", "b", person="ann"),
    recorded("d5", "a", person="cid"),
    recorded("d6", "b", person="bob"),
]


def some(n: int) -> list[Demonstration]:
    return [recorded(f"{i:02d}", "a") for i in range(n)]


@given(st.integers(2, 30), st.data())
def test_folds_are_index_modulo_k_and_test_each_recording_once(n, data):
    k = data.draw(st.integers(2, n))
    folds = make_folds(some(n), f"kfold:{k}")
    assert len(folds) == k
    for f, (train, test) in enumerate(folds):
        assert test == [i for i in range(n) if i % k == f]
        assert sorted(train + test) == list(range(n))
    assert sorted(i for _, test in folds for i in test) == list(range(n))


@given(st.integers(2, 30))
def test_leave_one_out_is_as_many_folds_as_recordings(n):
    assert make_folds(some(n), "loo") == make_folds(some(n), f"kfold:{n}")


@pytest.mark.parametrize(("n", "protocol"), [(0, "loo"), (1, "loo"), (3, "kfold:4")])
def test_too_few_recordings_for_a_protocol(n, protocol):
    with pytest.raises(ArgumentError, match=f"at least {4 if n == 3 else 2} recordings, got {n}"):
        make_folds(some(n), protocol)


def test_a_person_is_left_out_at_a_time_by_a_key_that_all_have():
    assert make_folds(PEOPLE, "logo:person") == [
        ([1, 2, 4, 5], [0, 3]),
        ([0, 3, 4], [1, 2, 5]),
        ([0, 1, 2, 3, 5], [4]),
    ]
    with pytest.raises(ArgumentError, match=r"logo:group.*keys person in d3"):
        make_folds(PEOPLE, "logo:group")
    alone = [recorded(f"{i}", "a", person="ann") for i in range(4)]
    with pytest.raises(ArgumentError, match="at least two groups, got ann"):
        make_folds(alone, "logo:person")


def test_the_first_of_each_task_by_name_are_trained_on():
    assert make_folds(PEOPLE, "temporal:0.5") == [([0, 1, 2, 3], [4, 5])]
    assert make_folds(PEOPLE, "temporal:0.3") == [([1, 2], [0, 3, 4, 5])]
    assert make_folds(some(10), "temporal") == [(list(range(7)), [7, 8, 9])]
    assert make_folds(some(10), "temporal:0.999") == [(list(range(9)), [9])]
    assert make_folds([*PEOPLE, recorded("d0", "c")], "temporal")[0][1] == [4, 5]
    with pytest.raises(ArgumentError, match="two recordings of a task"):
        make_folds([recorded("1", "a"), recorded("2", "b")], "temporal")


WORDS = "kfold kfold: kfold:1 kfold:x kfold:-2 kfold:² holdout:x loo:3 LOO later logo logo:"


@pytest.mark.parametrize(
    "protocol", ["", *WORDS.split(), "temporal:", "temporal:0", "temporal:1", "temporal:x"]
)
def test_other_words_name_the_protocols(protocol):
    with pytest.raises(ArgumentError, match="loo, kfold:K, logo:KEY or temporal"):
        make_folds(PEOPLE, protocol)


def test_merged_folds_test_everything_once_and_train_on_nothing_they_test():
    for n, most in ((29, 10), (12, 10), (4, 10)):
        merged = merge_folds(make_folds(some(n), "loo"), most)
        assert len(merged) == min(n, most)
        assert sorted(i for _, test in merged for i in test) == list(range(n))
        assert all(sorted([*train, *test]) == list(range(n)) for train, test in merged)
    temporal = make_folds(PEOPLE, "temporal")
    assert merge_folds(temporal, 10) == temporal
