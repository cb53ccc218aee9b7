# SPDX-License-Identifier: Apache-2.0
"""How probable a left-out demonstration ever makes other tasks than its own, and what follows.

From the odds follows from which probability a task may be acted on (`promp.risk_of`,
docs/recognition.md). Those of hypotheses that are born on the way say what must speak for a change
of mind before it counts: they fit people who do not quite move as they were taught, too, and a
change of mind has to be more probable than that (docs/decisions/change_of_mind.md). Demonstrations
of a person are left out together, so that the odds are those of somebody new; where nobody else was
recorded, one demonstration after the other.
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
"""Demonstrations that are followed at most. Convention: it bounds the time; 19 suffice for a share
of one in twenty."""


def learn_left_out_odds(
    library: TaskLibrary,
    tasks: Mapping[str, TaskStatistics],
    recorded: Mapping[str, TaskStatistics],
) -> LeftOutOdds:
    """The largest odds against its own task along each demonstration that was left out.

    Args:
        library: the learned tasks, with all margins.
        tasks: statistics that it was built from.
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
    """What is largest along each demonstration that was left out, and who showed it, if known."""
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
    """Evidence by which turning to another task is held to be rarer, in nats, zero or more.

    Arguments as of `learn_left_out_odds`; the margin of the library is not used.
    """
    odds, _ = _of_left_out(library, tasks, recorded, largest_odds)
    # another task becomes more probable than the true one in one movement of twenty
    return max(conformal_bound(np.array(odds), 0.05), 0.0) if len(odds) > 1 else 0.0


def largest_odds(library: TaskLibrary, task: int, recorded: TrainingExample) -> float:
    """Highest log odds along a movement of other tasks that were born on the way.

    At least `-NEGLIGIBLE`: less probable hypotheses are given up. Evidence counts as it is here,
    and to a power later (`filtering.posterior.counted_joint`): the margin is a cautious one.
    """
    largest = -NEGLIGIBLE
    for run in follow(replace(library, switch_margin=0.0), recorded):
        assert run.births is not None
        left, born = run.births.onset_log_joint(run.log_evidence)[:-1], run.births.log_joint[:-1]
        others = np.logaddexp.reduce(np.delete(born, task))
        largest = max(largest, float(others - np.logaddexp.reduce(np.r_[left, born[task]])))
    return largest


def follow(library: TaskLibrary, recorded: TrainingExample) -> Iterator[MovementFilter]:
    """The filter after each sample of a movement."""
    grid = make_prior_grid(library, n_scales=N_SCALES)
    run = MovementFilter(library, grid, 0, switching=True)
    stamps_ns = np.round(sample_phases() * recorded.duration_s * 1e9).astype(np.int64)
    for observation in observations_of(library.observed_groups, stamps_ns, recorded.observed):
        run.observe(observation)
        yield run
