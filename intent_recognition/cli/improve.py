# SPDX-License-Identifier: Apache-2.0
"""`intent improve`: let the robot practise a task, and take over what it has come to."""

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console

from intent_recognition.cli.console import print_facts, progress_bar
from intent_recognition.cli.help import examples
from intent_recognition.cli.options import Subparsers, number
from intent_recognition.cli.output import (
    PRINTED,
    add_json_option,
    check_json,
    console_beside,
    write_json,
)
from intent_recognition.durable import copy
from intent_recognition.errors import ArgumentError, ModelError, describe
from intent_recognition.model import load_pouring_skill, save_pouring_skill
from intent_recognition.share import share_path

if TYPE_CHECKING:
    from intent_recognition.warping import PouringSkill
    from sim_bridge.practice import Cost, PracticeSession, Rollout
    from sim_bridge.scenarios.pouring import PouringPractice

POURING, THUMBS = "pouring", "thumbs"
START, SKILL, BEFORE = "start.npz", "skill.npz", "skill.before.npz"
ROLLOUTS = 40
"""Rollouts of a practice unless more are asked for. Convention: a person still watches as many."""
CHECKS = 5
"""Rollouts with which the start and what practice has come to are compared at the end."""


def add_parser(subparsers: Subparsers) -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "improve",
        help="let the robot practise a task until it costs less",
        description="Let the robot practise: it tries paths within two standard deviations of what"
        " was demonstrated and within the arm's limits, each is logged as a bag and costs what"
        " --cost says. End it with Ctrl-C and give the same command to go on. Nothing is replaced"
        " before --accept.",
        **examples(
            (
                "spill less from a wide bowl, 40 pours in simulation",
                "intent improve pouring --short 0.9",
            ),
            ("with a cost of one's own", "intent improve pouring --cost my_cost.py"),
            ("say up or down after each pour", "intent improve pouring --cost thumbs"),
            ("take over what it has come to", "intent improve pouring --accept"),
        ),
    )
    parser.add_argument("task", choices=(POURING,), metavar="TASK", help="what: pouring")
    parser.add_argument(
        "--cost",
        default="spilled",
        metavar="FILE|NAME",
        help="spilled, level, thumbs, or a Python file with one function of a rollout (default:"
        " %(default)s)",
    )
    parser.add_argument("--cup", default="mug", help="container in the hand (%(default)s)")
    parser.add_argument("--into", default="tumbler", help="the other one (%(default)s)")
    parser.add_argument(
        "--wanted",
        type=number(int, 1, 40),
        default=40,
        metavar="N",
        help="balls wanted in the other one, of 40 (default: %(default)s)",
    )
    parser.add_argument(
        "--rollouts",
        type=number(int, 1),
        default=ROLLOUTS,
        metavar="N",
        help="in all, those of before included (default: %(default)s)",
    )
    parser.add_argument("--seed", type=number(int, 0), default=1, help="(default: %(default)s)")
    parser.add_argument(
        "--start",
        type=Path,
        metavar="BAGS|FILE",
        help="demonstrations, or an accepted skill, to begin with (default: the shipped ones)",
    )
    parser.add_argument(
        "--short",
        type=number(float, 0.0, 2.0),
        default=0.0,
        metavar="RADII",
        help="move the demonstrations on average so many radii of the opening too short, to have"
        " something to practise (default: %(default)s)",
    )
    parser.add_argument(
        "--output",
        type=Path,
        default=Path("practice"),
        metavar="DIR",
        help="folder of rollouts and results (default: %(default)s)",
    )
    action = parser.add_mutually_exclusive_group()
    action.add_argument(
        "--accept", action="store_true", help=f"write what practice has come to as {SKILL}"
    )
    action.add_argument("--undo", action="store_true", help="take the last --accept back")
    add_json_option(parser, "costs and outcomes")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Practise, accept or undo.

    Raises:
        ArgumentError: the cost cannot be used.
        ModelError: there is nothing to accept or to take back.
        ResourceBusyError: the folder holds another practice.
    """
    check_json(args.json)
    console = console_beside(args.json)
    if args.undo:
        return _undo(args.output, console)
    from intent_recognition.improvement import CovarianceSearch
    from sim_bridge.practice import Cost, PracticeSession, load_cost
    from sim_bridge.scenarios.pouring import PouringPractice

    cost = Cost(THUMBS, _thumb) if args.cost == THUMBS else load_cost(args.cost)
    with PouringPractice(_skill(args), args.cup, args.into, args.wanted) as practice:
        search = CovarianceSearch(practice.space.n_axes, args.seed)
        about = {"task": args.task, "cup": args.cup, "second": args.into}
        about |= {"wanted": args.wanted, "seed": args.seed, "short": args.short}
        session = PracticeSession(args.output, practice, search, cost, about)
        if args.accept:
            return _accept(args, session, practice, console)
        save_pouring_skill(args.output / START, practice.skill)
        _practise(session, args.rollouts, console)
        _report(args, session, practice, cost, console)
    return 0


def _skill(args: argparse.Namespace) -> "PouringSkill":
    from sim_bridge.scenarios.pouring import learn_pouring_skill, read_demonstrated, short_skill

    if args.start is not None and args.start.is_file():
        if args.short:
            cure = "Give a folder of demonstrations to --start, or leave --short out."
            raise ArgumentError(describe("--short", "demonstrations to move", args.start, cure))
        return load_pouring_skill(args.start)
    bags = args.start or share_path("bags/pouring/train")
    if args.short:
        return short_skill(read_demonstrated(bags), args.short, args.seed)
    return learn_pouring_skill(bags, 1)


def _practise(session: "PracticeSession", rollouts: int, console: Console) -> None:
    if session.about["cost"] == THUMBS:  # the question has the terminal for itself
        while len(session.tried) < rollouts:
            session.step()
        return
    with progress_bar(console) as bar:
        task = bar.add_task("practising", total=rollouts, completed=len(session.tried))
        while len(session.tried) < rollouts:
            tried = session.step()
            bar.advance(task)
            bar.update(task, description=f"practising, last cost {tried.cost:.3g}")


def _report(
    args: argparse.Namespace,
    session: "PracticeSession",
    practice: "PouringPractice",
    cost: "Cost",
    console: Console,
) -> None:
    """Print and write what came of it."""
    numbers: dict[str, object] = {
        "about": session.about,
        "costs": session.costs.tolist(),
        "outcomes": [dict(one.outcome) for one in session.tried],
    }
    facts = {"rollouts": f"{len(session.tried)}, {args.output / 'rollouts'}"}
    facts["cost of the first, the cheapest"] = f"{session.costs[0]:.3g}, {session.costs.min():.3g}"
    if cost.name != THUMBS:
        means = {}
        for name, weights in (("start", practice.space.mean), ("settled", session.settled())):
            rolled = practice.check(weights, CHECKS)
            means[name] = float(np.mean([cost(one) for one in rolled]))
        numbers["checked"] = means
        facts[f"cost before, after ({CHECKS} fresh rollouts each)"] = (
            f"{means['start']:.3g}, {means['settled']:.3g}"
        )
    facts["to take it over"] = "the same command with --accept"
    if args.json != PRINTED:
        print_facts(console, facts)
    write_json(args.json, numbers)


def _accept(
    args: argparse.Namespace,
    session: "PracticeSession",
    practice: "PouringPractice",
    console: Console,
) -> int:
    skill = args.output / SKILL
    if not session.tried:
        cure = "Practise first: the same command without --accept."
        raise ModelError(describe(str(args.output), "rollouts", "none", cure))
    weights = session.settled()
    if np.array_equal(weights, practice.space.mean):
        got = f"none after {len(session.tried)} rollouts"
        cure = "Practise on: the same command with more --rollouts."
        raise ModelError(describe(str(args.output), "a better path than the first", got, cure))
    improved = practice.with_mean(weights)
    if skill.exists():
        before = load_pouring_skill(skill).primitive.mean
        if np.array_equal(before, weights):
            console.print(f"accepted before: {skill}", highlight=False, soft_wrap=True)
            return 0
        copy(skill, args.output / BEFORE)
    save_pouring_skill(skill, improved)
    console.print(f"accepted: {skill}", highlight=False, soft_wrap=True)
    return 0


def _undo(folder: Path, console: Console) -> int:
    """Take the last accepted skill back; the one before it returns, if there was one."""
    if not (folder / SKILL).exists():
        cure = "Accept first, or name the folder with --output."
        raise ModelError(describe(str(folder), "an accepted skill", "none", cure))
    if (folder / BEFORE).exists():
        (folder / BEFORE).replace(folder / SKILL)
        said = "the skill accepted before is back"
    else:
        (folder / SKILL).unlink()
        said = "nothing is accepted now"
    console.print(f"{folder}: {said}", highlight=False, soft_wrap=True)
    return 0


def _thumb(rollout: "Rollout") -> float:
    """A person's answer: 0 for up, 1 for down."""
    seen = ", ".join(f"{name} {value:g}" for name, value in rollout.outcome.items())
    sys.stderr.write(f"{seen}\n")
    while True:
        sys.stderr.write("u: thumb up, d: down, q: stop and go on later > ")
        sys.stderr.flush()
        answer = sys.stdin.readline()
        if answer.strip() in ("u", "d"):
            return float(answer.strip() == "d")
        if answer.strip() == "q" or not answer:
            raise KeyboardInterrupt
