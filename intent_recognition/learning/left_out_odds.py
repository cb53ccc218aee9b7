# SPDX-License-Identifier: Apache-2.0
"""Largest odds against the true task along left-out demonstrations, and the switch margin.

The odds determine from which probability a task may be acted on (`promp.risk_of`,
docs/recognition.md). The odds of hypotheses born during a movement determine the evidence that a
change of mind requires: such hypotheses also fit people who do not move quite as they were taught,
and a change of mind must be more probable than that (docs/decisions/change_of_mind.md).
Demonstrations of a person are left out together, so that the odds hold for a new person; where
nobody else was recorded, they are left out one by one.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace

import numpy as np

from intent_recognition.filtering import NEGLIGIBLE, MovementFilter, make_prior_grid
from intent_recognition.learning.examples import TrainingExample, sample_phases
from intent_recognition.learning.held_out_examples import N_SCALES, paired_examples
from intent_recognition.learning.left_out import LeavingOut
from intent_recognition.learning.statistics import TaskStatistics
from intent_recognition.promp import NO_ODDS, LeftOutOdds, TaskLibrary, conformal_bound
from intent_recognition.signals import observations_of

MAX_FOLLOWED = 40
"""Most demonstrations that are filtered. Bounds computing time; 19 suffice for a share of one in
twenty."""


def learn_left_out_odds(
    library: TaskLibrary,
    tasks: Mapping[str, TaskStatistics],
    recorded: Mapping[str, TaskStatistics],
) -> LeftOutOdds:
    """Largest odds against its own task along each left-out demonstration.

    Args:
        library: the learned tasks, with all margins.
        tasks: statistics that the library was built from.
        recorded: statistics of the examples as they were recorded.
    """
    odds, groups = _of_left_out(library, tasks, recorded, largest_odds_against)
    return LeftOutOdds(tuple(odds), tuple(groups)) if len(odds) > 1 else NO_ODDS


def _of_left_out(
    library: TaskLibrary,
    tasks: Mapping[str, TaskStatistics],
    recorded: Mapping[str, TaskStatistics],
    largest: Callable[[TaskLibrary, int, TrainingExample], float],
) -> tuple[list[float], list[str]]:
    """`largest` of each left-out demonstration; the group left out with it, or "" if alone."""
    odds, groups = list[float](), list[str]()
    leaving_out = LeavingOut(library, tasks)
    for k, example, as_recorded in paired_examples(tasks, recorded, MAX_FOLLOWED):
        without = leaving_out.unseen(k, example) if library.n_tasks > 1 else None
        if without is not None:
            odds.append(largest(without.as_library(), k, as_recorded))
            groups.append(example.group if leaving_out.group(example.group) else "")
    return odds, groups


def largest_odds_against(library: TaskLibrary, task: int, recorded: TrainingExample) -> float:
    """Highest log odds of the other tasks against the true one along a movement."""
    followed = follow(library, recorded)
    counted = [run.posterior(0).log_evidence + run.grid.log_task_prior for run in followed]
    total = np.array(counted)[:, :-1]
    others = np.logaddexp.reduce(np.delete(total, task, axis=1), axis=1)
    return float(np.max(others - total[:, task]))


def learn_switch_margin(
    library: TaskLibrary,
    tasks: Mapping[str, TaskStatistics],
    recorded: Mapping[str, TaskStatistics],
) -> float:
    """Learn the evidence that a change to another task must overcome, in nats, zero or more.

    The arguments are those of `learn_left_out_odds`; the library's own switch margin is not used.
    """
    odds, _ = _of_left_out(library, tasks, recorded, largest_odds)
    # another task becomes more probable than the true one in one movement of twenty
    return max(conformal_bound(np.array(odds), 0.05), 0.0) if len(odds) > 1 else 0.0


def largest_odds(library: TaskLibrary, task: int, recorded: TrainingExample) -> float:
    """Highest log odds of other tasks that were born during a movement.

    They are at least `-NEGLIGIBLE`, since less probable hypotheses are pruned. The evidence is not
    raised to a power here as it is online (`filtering.posterior.counted_joint`), which makes the
    margin cautious.
    """
    largest = -NEGLIGIBLE
    for run in follow(replace(library, switch_margin=0.0), recorded):
        assert run.births is not None
        left, born = run.births.onset_log_joint(run.log_evidence)[:-1], run.births.log_joint[:-1]
        others = np.logaddexp.reduce(np.delete(born, task))
        largest = max(largest, float(others - np.logaddexp.reduce(np.r_[left, born[task]])))
    return largest


def follow(library: TaskLibrary, recorded: TrainingExample) -> Iterator[MovementFilter]:
    """Filter a movement; yield the filter after each sample."""
    grid = make_prior_grid(library, n_scales=N_SCALES)
    run = MovementFilter(library, grid, 0, switching=True)
    stamps_ns = np.round(sample_phases() * recorded.duration_s * 1e9).astype(np.int64)
    for observation in observations_of(library.observed_groups, stamps_ns, recorded.observed):
        run.observe(observation)
        yield run
