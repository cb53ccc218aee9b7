# SPDX-License-Identifier: Apache-2.0
"""A rare label one letter off a frequent one is named; tasks that are others on purpose are not."""

import pytest

from intent_recognition.signals import label_doubts


def doubts(rare: str, often: str = "give_cup", n_rare: int = 1, n_often: int = 6) -> list[str]:
    labels = [often] * n_often + [rare] * n_rare
    return [str(found) for found in label_doubts((f"bag_{k}", one) for k, one in enumerate(labels))]


@pytest.mark.parametrize(
    "rare", ["give_cpu", "give_cu", "give_cupp", "give_cap", "Give cup", "GIVE-CUP", "givecup"]
)
def test_a_misspelt_label_is_named(rare):
    said = f"1 with the task {rare}, 6 with give_cup. Did you mean give_cup?"
    assert doubts(rare) == [f"bag_6: {said}"]


@pytest.mark.parametrize(
    ("rare", "often"),
    [
        ("give_plate", "give_cup"),
        ("give_cup2", "give_cup1"),
        ("give_cup_2", "give_cup"),
        ("reach_b", "reach_a"),
        ("a", "b"),
        ("nut", "cut"),
        ("left", "right"),
        ("___", "give_cup"),
    ],
)
def test_another_task_is_not(rare, often):
    assert doubts(rare, often) == []


def test_what_is_frequent_is_no_mistake():
    assert len(doubts("give_cpu", n_rare=2)) == 2
    assert doubts("give_cpu", n_rare=2, n_often=5) == doubts("give_cpu", n_rare=3, n_often=9) == []
    assert label_doubts([("a", None), ("b", "give")]) == label_doubts([]) == []
