# SPDX-License-Identifier: Apache-2.0
"""DOFs of a library that was learned from arrays, which have no topics."""

from collections.abc import Sequence
from itertools import accumulate, groupby, pairwise

from intent_recognition.bags import JOINT_STATE
from intent_recognition.demonstrations import DofEntry, DofSpec
from intent_recognition.promp import TaskLibrary


def dofs_of_arrays(library: TaskLibrary) -> DofSpec:
    """Describe each signal as a named vector (JointState) on a topic of its own.

    The topics are `human`, `robot` and `context`, or `human_1` and so on for several signals.
    Consecutive controlled DOFs of the same unit form one signal.
    """
    controlled = [len(list(same)) for _, same in groupby(library.controlled_units)]
    context = library.context
    spec = DofSpec(
        _entries("human", library.observed_names, library.observed_units, library.observed_groups),
        _entries("robot", library.controlled_names, library.controlled_units, controlled),
        context=()
        if context is None
        else _entries("context", context.names, context.units, context.groups, context=True),
    )
    return DofSpec.from_dict(spec.to_dict(), "library")


def _entries(
    topic: str,
    names: Sequence[str],
    units: Sequence[str],
    sizes: Sequence[int],
    *,
    context: bool = False,
) -> tuple[DofEntry, ...]:
    """One entry for each signal, with as many DOFs as `sizes` says."""
    ends = list(accumulate(sizes, initial=0))
    topics = [topic] if len(sizes) == 1 else [f"{topic}_{k + 1}" for k in range(len(sizes))]
    return tuple(
        DofEntry(own, JOINT_STATE, joints=tuple(names[a:b]), unit=units[a], context=context)
        for own, (a, b) in zip(topics, pairwise(ends), strict=True)
    )
