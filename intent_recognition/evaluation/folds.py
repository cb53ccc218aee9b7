# SPDX-License-Identifier: Apache-2.0
"""Protocols that split recordings into training and test sets."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence

from intent_recognition.errors import ArgumentError, check_whole
from intent_recognition.signals import Demonstration, numbered

Fold = tuple[list[int], list[int]]
"""Indices of training and of test recordings."""
PROTOCOLS = "loo, kfold:K, logo:KEY or temporal[:F]"


def make_folds(recordings: Sequence[Demonstration], protocol: str) -> list[Fold]:
    """Indices of training and test recordings, by protocol.

    Args:
        recordings: labelled demonstrations.
        protocol: "loo" leaves out one recording at a time; "kfold:K" makes K folds, by index modulo
            K; "logo:KEY" leaves out all recordings with the same value of a key of `metadata`, such
            as a person; "temporal" or "temporal:F" trains on the first share F of each task's
            recordings, sorted by name, and tests on the rest.

    Raises:
        ArgumentError: unknown protocol, or too few recordings or groups for it.
    """
    name, colon, argument = str(protocol).partition(":")
    recordings = [*numbered(recordings)]
    n = len(recordings)
    if name == "loo" and not colon:
        return _by_index(n, n)
    if name == "kfold" and argument.isdecimal() and int(argument) >= 2:
        return _by_index(n, int(argument))
    if name == "logo" and argument:
        return _by_group(recordings, argument)
    if name == "temporal" and (not colon or _share(argument) is not None):
        return [_by_name(recordings, _share(argument) or 0.7)]
    raise ArgumentError.about("protocol", PROTOCOLS, protocol, "Choose one of these.")


def merge_folds(folds: Sequence[Fold], most: int) -> list[Fold]:
    """At most `most` folds that together test the same recordings, and train on none they test."""
    merged = []
    for first in range(min(most, len(folds))):
        group = folds[first::most]
        train = set.intersection(*(set(fold[0]) for fold in group))
        test = {index for fold in group for index in fold[1]}
        merged.append((sorted(train - test), sorted(test)))
    return merged


def of_learned_tasks(folds: Sequence[Fold], recordings: Sequence[Demonstration]) -> list[Fold]:
    """The folds without tests of tasks missing in their training set; empty folds are dropped."""
    found = []
    for train, test in folds:
        learned = {recordings[index].task for index in train}
        if shown := [index for index in test if recordings[index].task in learned]:
            found.append((train, shown))
    return found


def check_folds(folds: Sequence[Fold], n: int) -> list[Fold]:
    """Check a user's folds of n recordings, and return them as lists.

    Raises:
        ArgumentError: they are not pairs of indices, or an index is out of range.
    """
    expected = f"{PROTOCOLS}, or pairs of the indices to train and to test on"
    try:
        found = [([*train], [*test]) for train, test in folds]
    except (TypeError, ValueError):
        found = []
    if not found:
        cure = "Pass such as [([0, 1], [2]), ([1, 2], [0])]."
        raise ArgumentError.about("protocol", expected, repr(folds), cure)
    for k, fold in enumerate(found):
        for index in (*fold[0], *fold[1]):
            check_whole(f"protocol[{k}]", index, 0, "Count the demonstrations from 0.", n - 1)
    return found


def _by_index(n: int, k: int) -> list[Fold]:
    if n < 2 or k > n:
        cure = "Record more, or lower K."
        raise ArgumentError.about("protocol", f"at least {max(k, 2)} recordings", n, cure)
    return [_fold(n, range(f, n, k)) for f in range(k)]


def _by_group(recordings: Sequence[Demonstration], key: str) -> list[Fold]:
    """One fold per value of a key, in the order of the values."""
    groups = defaultdict(list)
    for index, recorded in enumerate(recordings):
        if key not in recorded.metadata:
            has = ", ".join(sorted(recorded.metadata)) or "none"
            expected = f"the key {key!r} in custom_data of every recording"
            got = f"the keys {has} in {recorded.name}"
            cure = "Choose a key that all have, or add it to metadata.yaml (arrays: group=)."
            raise ArgumentError.about(f"protocol logo:{key}", expected, got, cure)
        groups[recorded.metadata[key]].append(index)
    if len(groups) < 2:
        got = ", ".join(groups) or "no recording"
        cure = "Choose a key that tells recordings apart."
        raise ArgumentError.about(f"protocol logo:{key}", "at least two groups", got, cure)
    return [_fold(len(recordings), groups[value]) for value in sorted(groups)]


def _by_name(recordings: Sequence[Demonstration], share: float) -> Fold:
    """The first recordings of each task, by name, and the rest; at least one of each in both."""
    by_task = defaultdict(list)
    for index in sorted(range(len(recordings)), key=lambda i: recordings[i].name):
        by_task[recordings[index].task].append(index)
    test: list[int] = []
    for own in by_task.values():
        if len(own) > 1:
            test += own[min(max(round(share * len(own)), 1), len(own) - 1) :]
    if not test:
        cure = "Record more."
        raise ArgumentError.about("protocol", "two recordings of a task", len(recordings), cure)
    return _fold(len(recordings), sorted(test))


def _fold(n: int, test: Iterable[int]) -> Fold:
    left_out = set(test)
    return [i for i in range(n) if i not in left_out], sorted(left_out)


def _share(text: str) -> float | None:
    """A text as a number in (0, 1); None if it is not one."""
    try:
        share = float(text)
    except ValueError:
        return None
    return share if 0.0 < share < 1.0 else None
