# SPDX-License-Identifier: Apache-2.0
"""Let the robot practise in simulation. Each rollout tries a path within two standard deviations of
the demonstrations and within the limits of the arm, and gets a cost. After Ctrl-C the same
command continues. The skill in use changes only with --accept (docs/tutorials/practise.md).

task TASK         `pouring`, or the label of a task in --library
--cost FILE|NAME  what to lower: `spilled` (default) or `level` for pouring, `distance` (default) or
                  `time` for a task, `thumbs` (you judge each rollout), or a Python file with one
                  function from a rollout to a number
--rollouts N      rollouts in all, earlier ones included (default: %(default)s)
--seed SEED       random seed of practice (default: %(default)s)
--json OUT        costs and outcomes

for a task of a library:
--beside X Y Z  where the robot's hand should end, from where the person's comes to rest [m], along
                the axes of the arm's base (default: as demonstrated)
--moved X Y Z   offset added to that place [m] (default: 0 0 0)
--robot URDF    URDF of the arm that was taught (default: the LWR)

for pouring:
--cup CUP          container in the robot's hand (default: %(default)s)
--into INTO        container to pour into (default: %(default)s)
--wanted N         balls, of 40, that should end in it (default: %(default)s)
--start BAGS|FILE  demonstrations, or an accepted skill, to begin with (default: the shipped ones)
--short RADII      spoil the demonstrations: move them away from the container to pour into, on
                   average by so many of its radii (default: %(default)s)
--output DIR       folder of rollouts and results (default: practice)

the result, one of:
--accept  use the result: a task changes in its library, pouring is written as skill.npz into
          --output
--undo    take the last --accept back

# practise to pour from demonstrations that fall short, 40 pours in simulation
intent improve pouring --short 0.9
# bring the plate earlier
intent improve plate_handover --library tasks --cost time
# with your own cost
intent improve pouring --cost my_cost.py
# say up or down after each pour
intent improve pouring --cost thumbs
# accept the result
intent improve pouring --short 0.9 --accept
"""

import argparse
import sys
from functools import partial
from os.path import relpath

from rich.console import Console

from intent_recognition.cli import output
from intent_recognition.cli.console import print_facts, progress_bar, say
from intent_recognition.cli.improve_subjects import (
    THUMBS,
    Pouring,
    TaskOfFolder,
    is_pouring,
    subject_of,
    undo,
)
from intent_recognition.cli.options import number
from intent_recognition.cli.teach import add_library_options
from intent_recognition.improvement import Cost, PracticeSession, Rollout, compare, load_cost

CHECKS = 5
"""Number of fresh rollouts with which the initial and the improved skill are compared."""


OPTIONS = {
    "rollouts": {"type": number(int, 1), "default": 40},
    "seed": {"type": number(int, 0), "default": 1},
    "beside": number(float),
    "moved": {"type": number(float), "default": (0.0, 0.0, 0.0)},
    "cup": {"default": "mug"},
    "into": {"default": "tumbler"},
    "wanted": {"type": number(int, 1, 40), "default": 40},
    "short": {"type": number(float, 0.0, 2.0), "default": 0.0},
}
MORE = (partial(add_library_options, default=None),)


def run(args: argparse.Namespace) -> int:
    """Practise, accept or undo."""
    console = output.console_beside(args)
    if args.undo:
        _tell(args, "undone", undo(args, console))
        return 0
    with subject_of(args, console) as subject:
        known = subject.practice.costs
        asked = args.cost or known[0]
        cost = Cost(THUMBS, _thumb) if asked == THUMBS else load_cost(asked, known)
        session = subject.session(cost)
        if args.accept:
            _tell(args, "accepted", subject.accept(session))
            return 0
        _practise(session, args.rollouts, console)
        _report(args, session, subject, cost)
    return 0


def _tell(args: argparse.Namespace, what: str, said: str) -> None:
    """Print what was accepted or undone, and write it as JSON."""
    say(output.table_console(args), said)
    output.write_json(args.json, {what: said})


def _practise(session: PracticeSession, rollouts: int, console: Console) -> None:
    try:
        if session.about["cost"] == THUMBS:  # the question needs the terminal
            while len(session.tried) < rollouts:
                session.step()
            return
        with progress_bar(console) as bar:
            task = bar.add_task("practising", total=rollouts, completed=len(session.tried))
            while len(session.tried) < rollouts:
                tried = session.step()
                bar.advance(task)
                bar.update(task, description=f"practising, last cost {tried.cost:.3g}")
    except KeyboardInterrupt:
        done = f"stopped after {len(session.tried)} rollouts; the same command continues"
        sys.stderr.write(f"{done}\n")
        raise


def _report(
    args: argparse.Namespace, session: PracticeSession, subject: Pouring | TaskOfFolder, cost: Cost
) -> None:
    numbers: dict[str, object] = {
        "about": session.about,
        "costs": session.costs.tolist(),
        "outcomes": [dict(one.outcome) for one in session.tried],
    }
    facts = {"rollouts": f"{len(session.tried)}, {relpath(session.folder / 'rollouts')}"}
    facts["cost of the first, the cheapest"] = f"{session.costs[0]:.3g}, {session.costs.min():.3g}"
    if cost.name != THUMBS:
        found = compare(subject.practice, cost, session.best(), CHECKS)
        numbers["checked"] = {"start": found.before, "settled": found.after}
        whom = f"{CHECKS} fresh rollouts each" if is_pouring(args) else "beside other people"
        facts[f"cost before, after ({whom})"] = f"{found.before:.3g}, {found.after:.3g}"
        outcomes = {"start": found.outcome_before, "settled": found.outcome_after}
        numbers["checked_outcomes"] = outcomes
    accept = "the same command with --accept"
    facts["to take it over"] = accept if session.improved else "practise on: nothing is better yet"
    print_facts(output.table_console(args), facts)
    output.write_json(args.json, numbers)


def _thumb(rollout: Rollout) -> float:
    """A person's answer: 0 for up, 1 for down."""
    seen = ", ".join(f"{name} {value:.3g}" for name, value in rollout.outcome.items())
    sys.stderr.write(f"{seen}\n")
    while True:
        sys.stderr.write("u: thumb up, d: down, q: stop and go on later > ")
        sys.stderr.flush()
        answer = sys.stdin.readline()
        if answer.strip() in ("u", "d"):
            return float(answer.strip() == "d")
        if answer.strip() == "q" or not answer:
            raise KeyboardInterrupt
