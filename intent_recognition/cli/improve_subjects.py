# SPDX-License-Identifier: Apache-2.0
"""Subjects of `intent improve`: pouring, or a task of a folder of tasks."""

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console

from intent_recognition.cli.teach import (
    DEFAULT_LIBRARY,
    HANDED_OVER_S,
    refuse_other_model,
    teacher_node,
    wait_until_used,
)
from intent_recognition.cli.undo import FOUND_S
from intent_recognition.demonstrations import arm_in_world
from intent_recognition.durable import copy
from intent_recognition.errors import ArgumentError, ModelError
from intent_recognition.improvement import (
    Cost,
    CovarianceSearch,
    Practice,
    PracticeSession,
    check_task,
)
from intent_recognition.kinematics import read_urdf
from intent_recognition.model import (
    LIBRARY_MODEL,
    Change,
    PractisedTask,
    TaskFolder,
    load_pouring_skill,
    load_trained,
    now,
    save_pouring_skill,
    undo_practice,
)
from intent_recognition.share import share_path

if TYPE_CHECKING:
    from intent_recognition.warping import PouringSkill
    from sim_bridge.scenarios.pouring import PouringPractice

POURING, THUMBS = "pouring", "thumbs"
START, SKILL, BEFORE = "start.npz", "skill.npz", "skill.before.npz"
PRACTICE_FOLDER = Path("practice")


@contextmanager
def subject_of(args: argparse.Namespace, console: Console) -> "Iterator[Pouring | TaskOfFolder]":
    """Context with the subject that the arguments name."""
    if is_pouring(args):
        from sim_bridge.scenarios.pouring import PouringPractice

        skill = _skill(args)
        with PouringPractice(skill, args.cup, args.into, args.wanted) as practice:
            yield Pouring(args, practice)
    else:
        yield TaskOfFolder(args, console)


def is_pouring(args: argparse.Namespace) -> bool:
    """Whether pouring is practised, rather than a task of a folder."""
    return args.task == POURING and args.library is None


def undo(args: argparse.Namespace, console: Console) -> str:
    """Undo the last accepted practice; return the new state in words."""
    if not is_pouring(args):
        tasks, what = _folder(args), f"undid practice of {args.task}"
        return _changed(args, console, tasks, partial(undo_practice, tasks, args.task), what)
    folder = args.output or PRACTICE_FOLDER
    if not (folder / SKILL).exists():
        cure = "Accept first, or name the folder with --output."
        raise ModelError.about(str(folder), "an accepted skill", "none", cure)
    if (folder / BEFORE).exists():
        (folder / BEFORE).replace(folder / SKILL)
        return f"{folder}: restored the skill accepted before"
    (folder / SKILL).unlink()
    return f"{folder}: nothing is accepted now"


class Pouring:
    """Practice of pouring, whose skill is a file in the folder of practice."""

    def __init__(self, args: argparse.Namespace, practice: "PouringPractice") -> None:
        self._args, self.practice = args, practice
        self._folder = args.output or PRACTICE_FOLDER

    def session(self, cost: Cost) -> PracticeSession:
        """Session of the folder of practice, continued or new."""
        args, practice = self._args, self.practice
        about = {"task": POURING, "cup": args.cup, "second": args.into}
        about |= {"wanted": args.wanted, "seed": args.seed, "short": args.short}
        search = CovarianceSearch(practice.space.n_axes, args.seed, practice.step)
        session = PracticeSession(self._folder, practice, search, cost, about)
        if not args.accept:
            save_pouring_skill(self._folder / START, practice.skill)
        return session

    def accept(self, session: PracticeSession) -> str:
        """Accept the improved skill; return the result in words."""
        weights, skill = session.settled(), self._folder / SKILL
        if skill.exists():
            if np.array_equal(load_pouring_skill(skill).primitive.mean, weights):
                return f"accepted before: {skill}"
            copy(skill, self._folder / BEFORE)
        save_pouring_skill(skill, self.practice.with_mean(weights))
        return f"accepted: {skill}"


class TaskOfFolder:
    """Practice of a task in a folder of tasks, where it becomes a version of the model."""

    def __init__(self, args: argparse.Namespace, console: Console) -> None:
        if args.output is not None:
            cure = "Leave --output out: practice of a task is kept in its library."
            raise ArgumentError.about("--output", "the task pouring", args.task, cure)
        arm = None if args.robot is None else arm_in_world(read_urdf(args.robot))
        options = {"most_people": 1} if args.cost == THUMBS else {}
        self._practised = PractisedTask(
            _folder(args), args.task, beside_m=args.beside, moved_m=args.moved, arm=arm, **options
        )
        self._args, self._console = args, console
        self.practice: Practice = self._practised.practice

    def session(self, cost: Cost) -> PracticeSession:
        """Session with this cost and seed, continued or new."""
        return self._practised.session(cost, self._args.seed)

    def accept(self, session: PracticeSession) -> str:
        """Accept the improved task; return the result in words."""
        practised, what = self._practised, f"accepted practice of {self._practised.task}"
        accept = partial(practised.accept, session)
        return _changed(self._args, self._console, practised.folder, accept, what)


def _folder(args: argparse.Namespace) -> TaskFolder:
    path = args.library or DEFAULT_LIBRARY
    present = path / LIBRARY_MODEL
    if not present.exists() and args.model is None:
        cure = "Name the folder with --library, or a model to begin one with --model."
        expected = "a folder of tasks with a model"
        raise ModelError.about(str(path), expected, f"no {LIBRARY_MODEL} in it", cure)
    refuse_other_model(path, args.model, args.dofs)
    model = present if present.exists() else args.model
    loaded, _ = load_trained(model)  # fails before anything is created
    check_task(args.task, loaded.library.labels)
    folder = TaskFolder(path, loaded.dofs, now)
    if not present.exists():
        folder.start_from(model)
    return folder


def _changed(
    args: argparse.Namespace,
    console: Console,
    folder: TaskFolder,
    change: Callable[[], Change],
    what: str,
) -> str:
    """Change a folder of tasks and hand the model to a running estimator; return the status."""
    if find_spec("rclpy") is None:
        change()
        return f"{what}; no estimator was notified: ROS 2 is not installed"
    args.library = folder.path
    with teacher_node(args) as (teacher, spin):
        if spin(teacher.estimator_runs, FOUND_S):
            spin(lambda: teacher.loaded is not None, HANDED_OVER_S)
            if not teacher.knows_loaded():
                change()
                runs = teacher.loaded or "an unknown model"
                return f"{what}; not in use: the estimator runs {runs}"
        return wait_until_used(teacher, spin, console, teacher.changed(change(), what))


def _skill(args: argparse.Namespace) -> "PouringSkill":
    from sim_bridge.scenarios.pouring import learn_pouring_skill, read_demonstrated, short_skill

    if args.start is not None and args.start.is_file():
        if args.short:
            cure = "Give a folder of demonstrations to --start, or leave --short out."
            expected = "a folder of demonstrations with --short"
            raise ArgumentError.about("--start", expected, args.start, cure)
        return load_pouring_skill(args.start)
    bags = args.start or share_path("bags/pouring/train")
    if args.short:
        return short_skill(read_demonstrated(bags), args.short, args.seed)
    return learn_pouring_skill(bags, 1)
