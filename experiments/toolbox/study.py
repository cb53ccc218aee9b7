# SPDX-License-Identifier: Apache-2.0
"""Study of the unlabelled toolbox: fits, predictions, and sessions."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.draws import Draw, draw_again
from experiments.left_out import (
    FINAL,
    LeftOutMixture,
    Pairs,
    TriedNumber,
    majority_names,
    pairs_of,
    predict,
    rms,
    try_numbers,
)
from experiments.settings import Settings
from experiments.toolbox.session import HAND_TASKS, ToolboxExecution, play
from intent_recognition.array_types import Flags, Floats
from intent_recognition.demonstrations import load_dofs, read_demonstrations
from intent_recognition.kinematics import hand_position
from intent_recognition.learning import (
    TrainingSettings,
    label_by_components,
    learn_components,
    purity,
)
from intent_recognition.promp import TaskLibrary
from intent_recognition.report import readable
from intent_recognition.signals import Demonstration
from sim_bridge.coworker import parse_task_list, plan_session

LARGEST_NUMBER = 10
QUICK_LARGEST = 3
SESSIONS = 10
"""Sessions of executions, each drawn from a seed of its own, to show the spread."""
EXECUTIONS = 4
"""Executions in each; 40 in all, as many as in the paper."""
QUICK_EXECUTIONS = 3
"""Executions in each of a quick run."""
WHOLE_NAME, END_NAME = "whole", "end alone"
"""Whether a component is taken from the whole movement or from the wrist's end alone."""
SESSION_SEED = 7000
"""Added to the seed, so that no session repeats a demonstration."""


@dataclass(frozen=True)
class ToolboxStudy:
    """Results of the study.

    Attributes:
        demonstrations: in the order of all arrays.
        pairs: both agents at the same phases.
        tasks: labels, for scoring alone.
        tried: every number of components.
        end_rms_rad: error of the joints predicted by each from the final position, the component
            known (K, n).
        chosen: the number taken.
        from_end: with it, predicted from the wrist's final position, the component recognised
            from the whole movement.
        end_alone: the same, the component recognised from the final position too.
        names: the task that most members of each of the library's components are.
        executions: the interactions of all sessions before the online estimator.
        draws: the recordings drawn again, the shipped ones first.
    """

    demonstrations: tuple[Demonstration, ...]
    pairs: Pairs
    tasks: NDArray[np.str_]
    tried: tuple[TriedNumber, ...]
    end_rms_rad: Floats
    chosen: int
    from_end: LeftOutMixture
    end_alone: LeftOutMixture
    names: Mapping[str, str] = field(default_factory=dict)
    executions: tuple[ToolboxExecution, ...] = ()
    draws: tuple[Draw, ...] = ()

    @property
    def taken(self) -> TriedNumber:
        """Results with the number of components chosen."""
        return self.tried[self.chosen - 1]

    @property
    def n_right(self) -> int:
        """Executions with the right task and no other."""
        return sum(one.right for one in self.executions)

    def hand_error_m(self, predicted: LeftOutMixture) -> Floats:
        """Distance of the predicted final hand from the demonstrated one (n,)."""
        ends = predicted.mean[:, -1], self.pairs.controlled[:, -1]
        return np.linalg.norm(hand_position(ends[0]) - hand_position(ends[1]), axis=1)

    def recognised(self, predicted: LeftOutMixture) -> Flags:
        """Whether each was predicted by the component of its own task, bool (n,)."""
        majority = majority_names(self.tasks, self.taken.labels)
        return np.array([majority[k] for k in predicted.component]) == self.tasks


def investigate(settings: Settings) -> ToolboxStudy:
    """Fit, predict and play the session."""
    settings.progress(0.0, "reading")
    found = leave_each_out(settings.recordings("toolbox/train"), settings)
    settings.progress(0.2, "learning the components")
    library, names = learn_unlabelled(list(found.demonstrations), found.chosen, settings.rng(100))
    count, n_sessions = (QUICK_EXECUTIONS, 1) if settings.quick else (EXECUTIONS, SESSIONS)
    executions: list[ToolboxExecution] = []
    for session in range(n_sessions):
        settings.progress(0.25 + 0.35 * session / n_sessions, "executions")
        seed = SESSION_SEED + settings.seed + session
        executions += play(
            library, names, plan_session(seed, parse_task_list("random", seed, count))
        )
    draws = [Draw(settings.seed, numbers_of_draw(found))]
    if not settings.quick:
        silent = replace(settings, progress=lambda share, what: None)
        draws += draw_again(
            settings,
            "toolbox",
            lambda folder: numbers_of_draw(leave_each_out(folder / "toolbox/train", silent)),
            keep=lambda folder: "train" in folder.parts,
            progress=lambda share: settings.progress(0.6 + 0.35 * share, "other seeds"),
        )
    return replace(found, names=names, executions=tuple(executions), draws=tuple(draws))


def leave_each_out(recordings: Path, settings: Settings) -> ToolboxStudy:
    """Mixtures of some recordings and their left-out predictions; nothing is executed."""
    demonstrations, _ = read_demonstrations([recordings], load_dofs())
    pairs = pairs_of(demonstrations)
    largest = QUICK_LARGEST if settings.quick else LARGEST_NUMBER
    tried, chosen = try_numbers(pairs, largest, settings)
    from_end = [predict(pairs, t.mixtures, FINAL, t.predicted.component) for t in tried]
    return ToolboxStudy(
        tuple(demonstrations),
        pairs,
        np.array([d.task for d in demonstrations]),
        tried,
        np.array([rms(p.mean - pairs.controlled) for p in from_end]),
        chosen,
        from_end[chosen - 1],
        predict(pairs, tried[chosen - 1].mixtures, FINAL),
    )


def numbers_of_draw(study: ToolboxStudy) -> dict[str, float]:
    """Results of a draw of the recordings: counts, and mean errors of the hand [cm]."""
    n = len(study.tasks)
    numbers: dict[str, float] = {
        "components": study.chosen,
        "in their own": round(purity(study.tasks.tolist(), study.taken.labels) * n),
        "right from the end": int(study.recognised(study.end_alone).sum()),
    }
    for name, predicted in ((WHOLE_NAME, study.from_end), (END_NAME, study.end_alone)):
        errors = 100.0 * study.hand_error_m(predicted)
        for task in HAND_TASKS:
            numbers[f"{readable(task)}, {name}"] = float(errors[study.tasks == task].mean())
    return numbers


def learn_unlabelled(
    demonstrations: list[Demonstration], n_components: int, rng: np.random.Generator
) -> tuple[TaskLibrary, dict[str, str]]:
    """What `intent train --unlabelled` learns, and the task that each component is mostly of."""
    settings = TrainingSettings()
    found = label_by_components(demonstrations, settings, rng, n_components=n_components)
    library = learn_components(found, settings).library
    task_of = {d.name: d.task for d in demonstrations}
    tasks = np.array([task_of[d.name] for d in found.demonstrations])
    labels = np.array([d.task for d in found.demonstrations])
    names = {}
    for label in library.labels:
        members, counts = np.unique(tasks[labels == label], return_counts=True)
        names[label] = str(members[counts.argmax()])
    return library, names
