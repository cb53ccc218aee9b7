# SPDX-License-Identifier: Apache-2.0
"""Cross-validation of the box assembly by two humans.

Every fifth demonstration of each task is left out in turn. Recognition and prediction are scored
on all of them; those of the first turn are also run on the arm, which takes the assistant's place.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from experiments.assembly.aligned import aligned_evidence
from experiments.assembly.arm_stand_in import StoodIn, stand_in
from experiments.assembly.scores import N_OBSERVATIONS, Scored, score
from experiments.settings import Settings
from intent_recognition.alignment import Alignment, align, even_trajectory
from intent_recognition.array_types import Floats
from intent_recognition.demonstrations import load_dofs, read_demonstrations
from intent_recognition.errors import BagError
from intent_recognition.evaluation import sample
from intent_recognition.learning import (
    Timing,
    TrainingSettings,
    cut_one,
    learn_with_report,
    library_from_statistics,
)
from intent_recognition.promp import TaskLibrary
from intent_recognition.share import share_path
from intent_recognition.signals import Demonstration

FOLDS = 5
NONE_PRIOR = 1e-6
"""The paper has no `none`: here every movement is one of the tasks."""
QUICK_SESSION, QUICK_PER_TASK = "session_00", 8
"""Session of a quick run, and its demonstrations of each task, of which one is left out."""
ARRIVED_M = 0.03
"""Distance from where it ends within which a wrist or hand has arrived [m]."""
AFTER_ARRIVAL_S = 0.2
"""Time over which the end of a path is averaged [s]."""


class StandInScore(NamedTuple):
    """One left-out interaction with the arm in the assistant's place.

    Attributes:
        task: the true one.
        run: what the arm did.
        wrist_m: where the assistant's wrist was at the times of the run, (T, 3).
        end_m: distance of the hand from the wrist where both end.
        path_m: root mean square of their distance over the interaction.
        late_s: how much later than the wrist the hand arrived.
        followed_m: largest distance of the hand from where its commands had it.
    """

    task: str
    run: StoodIn
    wrist_m: Floats
    end_m: float
    path_m: float
    late_s: float
    followed_m: float


class AssemblyFold(NamedTuple):
    """One fold of the cross-validation.

    `library` and `aligned` are learned from `training`, the latter from aligned demonstrations with
    `timing`. `training` and `left_out` are cut to their movements; `as_recorded` is not.
    """

    library: TaskLibrary
    aligned: TaskLibrary
    timing: Timing
    training: list[Demonstration]
    left_out: list[Demonstration]
    as_recorded: list[Demonstration]


@dataclass(frozen=True)
class AssemblyStudy:
    """Results of the study.

    Attributes:
        first: the first fold; examples in figures come from it.
        scored: every left-out demonstration.
        executed: those the arm took part in.
        alignments: per task, of all demonstrations of the first fold's training.
        unaligned: per task, the same before, (n, G, 6).
    """

    first: AssemblyFold
    scored: tuple[Scored, ...]
    executed: tuple[StandInScore, ...]
    alignments: dict[str, Alignment]
    unaligned: dict[str, Floats]


def study(settings: Settings) -> AssemblyStudy:
    """Read, learn, score and execute."""
    demonstrations = read(settings)
    if settings.quick:
        demonstrations = _few(demonstrations)
    numbers = fold_numbers(demonstrations, QUICK_PER_TASK if settings.quick else FOLDS)
    turns = [0] if settings.quick else range(FOLDS)
    folds, scored = [], []
    for turn in turns:
        settings.progress(0.6 * turn / len(turns), f"learning without part {turn + 1}")
        fold = leave_out(demonstrations, numbers, turn)
        folds.append(fold)
        warps = fold.timing.warps(fold.left_out)
        for k, (left_out, warp) in enumerate(zip(fold.left_out, warps, strict=True)):
            done = (turn + 0.4 + 0.6 * k / len(fold.left_out)) / len(turns)
            settings.progress(0.6 * done, left_out.name)
            evidence = aligned_evidence(fold.aligned, warp, left_out, N_OBSERVATIONS)
            scored.append(score(fold.library, fold.training, left_out, evidence))
    first = folds[0]
    alignments, unaligned = _align(first.training)
    executed, n = [], len(first.as_recorded)
    for k, recording in enumerate(first.as_recorded):
        settings.progress(0.6 + 0.4 * k / n, f"the arm in {recording.name}")
        (cut,) = (d for d in first.left_out if d.name == recording.name)
        executed.append(execute(first.library, recording, cut))
    return AssemblyStudy(first, tuple(scored), tuple(executed), alignments, unaligned)


def read(settings: Settings) -> list[Demonstration]:
    """The demonstrations of two humans; of the first session alone if quick.

    Raises:
        BagError: there is none.
    """
    folder = settings.recordings("assembly")
    if settings.quick:
        folder = folder / QUICK_SESSION
    dofs = load_dofs(share_path("config/dofs_two_humans.yaml"))
    demonstrations, rejections = read_demonstrations(folder, dofs)
    if not demonstrations:
        got = rejections[0] if rejections else "none"
        cure = "Generate them: python -m experiments.generate --scenario assembly."
        raise BagError.about(str(folder), "demonstrations of two humans", got, cure)
    return demonstrations


def fold_numbers(demonstrations: Sequence[Demonstration], n_folds: int) -> list[int]:
    """Fold of each demonstration: dealt out in turn, task by task."""
    seen: dict[str, int] = {}
    numbers = []
    for demonstration in demonstrations:
        task = str(demonstration.task)
        count = seen.get(task, 0)
        numbers.append(count % n_folds)
        seen[task] = count + 1
    return numbers


def leave_out(
    demonstrations: Sequence[Demonstration], numbers: Sequence[int], turn: int
) -> AssemblyFold:
    """Learn from all folds but one; the movement's thresholds come from them alone."""
    training = [d for d, part in zip(demonstrations, numbers, strict=True) if part != turn]
    as_recorded = [d for d, part in zip(demonstrations, numbers, strict=True) if part == turn]
    report = learn_with_report(training, TrainingSettings(none_prior=NONE_PRIOR, switching=False))
    library = report.library
    preprocessing = report.trained.preprocessing
    aligned = library_from_statistics(
        report.trained.tasks, preprocessing, report.chosen._replace(pace="aligned")
    )
    cut, left_out = (
        [cut_one(d, preprocessing.onset, preprocessing.controlled_onset) for d in part]
        for part in (training, as_recorded)
    )
    return AssemblyFold(library, aligned, preprocessing.timing, cut, left_out, as_recorded)


def execute(library: TaskLibrary, recording: Demonstration, cut: Demonstration) -> StandInScore:
    """Let the arm take the assistant's place in one recording, and compare.

    `cut` is the recording from the worker's onset to both agents' rest.
    """
    run = stand_in(library, recording)
    wrist = sample(recording.controlled, recording.start_ns, run.times_s)
    distance = np.linalg.norm(run.hand_m - wrist, axis=1)
    start_s = (cut.start_ns - recording.start_ns) * 1e-9
    end_s = (cut.end_ns - recording.start_ns) * 1e-9
    during = (run.times_s >= start_s) & (run.times_s <= end_s)
    asked = np.linalg.norm(run.hand_m - run.asked_m, axis=1)
    return StandInScore(
        str(recording.task),
        run,
        wrist,
        float(np.linalg.norm(_end(run.hand_m) - _end(wrist))),
        float(np.sqrt(np.mean(distance[during] ** 2))),
        arrival_s(run.times_s, run.hand_m) - arrival_s(run.times_s, wrist),
        float(asked.max()),
    )


def arrival_s(times_s: Floats, path_m: Floats) -> float:
    """From when on a path (T, 3) stays near where it ends, at the latest its last sample."""
    away = np.flatnonzero(np.linalg.norm(path_m - _end(path_m), axis=1) > ARRIVED_M)
    return float(times_s[min(away[-1] + 1, len(times_s) - 1)] if away.size else times_s[0])


def _end(path_m: Floats) -> Floats:
    """Where a path sampled every 10 ms ends, (3,)."""
    return path_m[-round(100 * AFTER_ARRIVAL_S) :].mean(axis=0)


def _few(recordings: Sequence[Demonstration]) -> list[Demonstration]:
    """The first few recordings of each task."""
    per_task = fold_numbers(recordings, len(recordings))
    return [d for d, k in zip(recordings, per_task, strict=True) if k < QUICK_PER_TASK]


def _align(training: Sequence[Demonstration]) -> tuple[dict[str, Alignment], dict[str, Floats]]:
    """Each task's demonstrations after and before alignment, at the same phases."""
    alignments, unaligned = {}, {}
    for task in sorted({str(d.task) for d in training}):
        paths = [
            even_trajectory((*d.observed, *d.controlled), d.start_ns, d.end_ns)
            for d in training
            if d.task == task
        ]
        alignments[task] = align(paths)
        n_grid = alignments[task].aligned.shape[1]
        rows = np.linspace(0, len(paths[0]) - 1, n_grid).round().astype(int)
        unaligned[task] = np.array(paths)[:, rows]
    return alignments, unaligned
