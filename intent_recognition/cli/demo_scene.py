# SPDX-License-Identifier: Apache-2.0
"""Contents of a demo's session: recordings to learn from, the worker's plan, an arm."""

import argparse
from collections import defaultdict
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError, KinematicsError
from intent_recognition.nodes.graph import ARMS, RECOGNITION
from intent_recognition.plans import read_plan
from intent_recognition.registry import RECORDED
from intent_recognition.share import share_path
from intent_recognition.untrusted import read_text

if TYPE_CHECKING:
    from sim_bridge.arm import Robot
    from sim_bridge.coworker import SessionPlan
    from sim_bridge.scenarios.toolbox import Scoring, ToolboxArm

CELL = "cell"
LIVE = ("toolbox", "assembly", CELL)
"""Scenarios with a worker and an arm that run as a graph of nodes."""
LWR = "lwr"
BASES_M = ((0.0, 0.0, 0.0), (0.12, 0.0, 0.05), (0.3, -0.05, 0.1), (0.5, -0.1, 0.15))
"""Positions to try for the base of a user's arm, world [m]; the first from which it reaches all
places is taken. They approach the worker; an arm of 0.4 m reaches all places from the last."""
CELL_PLAN = "config/examples/cell_plan.yaml"
"""Work plan of the scenario `cell`."""
CELL_BOXES = ("bin 0.56 -0.26 0.12 0.04 0.04 0.24", "lamp 0.62 -0.14 0.555 0.06 0.05 0.10")
"""Obstacles of the arm in the scenario `cell`. They lie below the path to the screwdriver and above
the path to plates and screws, and keep 2.5 cm clear of the LWR at the stands and at all handovers:
an obstacle that touches the end of a path leaves no path."""
CELL_PEOPLE = ("anna", "ben")
"""Names of the people in the scenario `cell`."""
WITH_PEOPLE = ("coworker_sim", "object_transfer", *RECOGNITION)
"""Nodes that get the names of the people, in addition to the arm's nodes."""
OF_EACH = (
    *("mocap/wrist/pose", "coworker/task"),
    *("intent/tasks", "intent/robot_trajectory", "intent/next_task"),
)
"""Recorded topics of which each named person has one."""
CELL_SEPARATION: Mapping[str, object] = {
    "person_dofs": [f"mocap/wrist/pose.pose.position.{axis}" for axis in "xyz"],
    "human_speed": 0.5,
    "intrusion": 0.05,
    "least_speed": 0.15,
}
"""Speed and separation of the arm in the scenario `cell` [m/s], [m]: both people's hands wait for
the arm, or go where their prediction says."""


class Scene(NamedTuple):
    """Definition of a session."""

    bags: str  # shipped recordings to learn from
    dofs: str  # shipped DOF file of the recordings; empty: the default
    sessions: str  # shipped recordings for the transition prior; empty: none
    graph: str  # name of the graph of nodes
    arguments: Mapping[str, object]  # arguments of the graph
    own: Mapping[str, Mapping[str, object]]  # parameters that depend on the arm, by node
    plans: Mapping[str, "SessionPlan"]  # each worker's plan by name; the only one's name is empty
    scorings: Mapping[str, "Scoring"]  # by worker: desired and actual position of the hand
    note: str = ""  # remark on the arm for the user; empty for none


def make_scene(args: argparse.Namespace) -> Scene:
    """The session that the options of `intent demo` describe."""
    return _assembly(args) if args.scenario == "assembly" else _toolbox(args)


def session_tasks(args: argparse.Namespace) -> dict[str, tuple[str, ...]]:
    """Each worker's task list by name, with some tasks changed midway."""
    from sim_bridge.coworker import change_some, parse_task_list, work_shares

    people = CELL_PEOPLE if args.scenario == CELL else ("",)
    if args.scenario == CELL and args.task_list == "habit":
        plan = read_plan(read_text(share_path(CELL_PLAN)))
        shares = work_shares(plan, args.seed, len(people), args.interactions)
    else:
        tasks = parse_task_list(args.task_list, args.seed, args.interactions)
        shares = tuple(tasks[k :: len(people)] for k in range(len(people)))
    busy = {person: share for person, share in zip(people, shares, strict=True) if share}
    own = [args.changes // len(busy) + (k < args.changes % len(busy)) for k in range(len(busy))]
    return {
        person: change_some(share, args.seed, n)
        for (person, share), n in zip(busy.items(), own, strict=True)
    }


def _toolbox(args: argparse.Namespace) -> Scene:
    """Scene of the toolbox: the LWR is controlled by joints, other arms by the hand's pose."""
    from sim_bridge.arm import NAMES, find_robot
    from sim_bridge.coworker import SessionTiming, plan_people
    from sim_bridge.handover import with_fingers
    from sim_bridge.scenarios.toolbox import (
        HOME,
        HOME_HAND_M,
        LIFT_M,
        ONE_HOLDS_S,
        STANDS_M,
        Scoring,
        by_force_with,
        toolbox_places,
    )

    tasks = session_tasks(args)
    usual = args.arm in NAMES or args.scenario == CELL
    by_force = usual if args.transfers is None else args.transfers
    # With two people at one arm, the second gets the object up to 11 s after their movement:
    # 3 s for the other person, and 5 s for an arm that passes two hands.
    hold_s = ONE_HOLDS_S if len(tasks) == 1 else (13.0, 14.0)
    timing = SessionTiming(hold_s=hold_s) if by_force else SessionTiming()
    sessions = plan_people(args.seed, list(tasks.values()), timing)
    plans = dict(zip(tasks, sessions, strict=True))
    places = {person: toolbox_places(plan) for person, plan in plans.items()}
    places_m = np.concatenate(list(places.values()))
    plain = args.arm == LWR and not (args.base or args.tip)
    fetched_m = np.concatenate([list(STANDS_M.values()), np.add(list(STANDS_M.values()), LIFT_M)])
    reached_m = np.concatenate([places_m, fetched_m])
    arm = None if plain else _arm(args, HOME_HAND_M, reached_m, by_force)
    home = HOME.tolist() if arm is None else arm.home.tolist()
    named: dict[str, object] = {"arm": "", "hand_link": "", "transfers": by_force}
    of_arm: dict[str, object] = {"initial_position": home}
    if arm is not None:
        named |= {"arm": arm_file(args, arm.robot), "hand_link": arm.robot.tip}
        tip = find_robot(args.arm, base=args.base, tip=args.tip).tip
        of_arm |= {"tip": tip, "base_position": list(arm.robot.base_position_m)}
    own: dict[str, dict[str, object]] = defaultdict(dict)
    own |= {"primitive_activation": {"home": home}, "arm_sim": of_arm}
    if args.scenario == CELL:
        named |= {"plan": str(share_path(CELL_PLAN)), "scene": CELL}
        things = {"boxes": list(CELL_BOXES)}
        for arm_node in ARMS:
            own[arm_node] |= things
        own["primitive_activation"] |= {**things, "clearance": 0.02, **CELL_SEPARATION}
    if people := [person for person in plans if person]:
        for node in (*WITH_PEOPLE, *ARMS):
            own[node] |= {"persons": people}
        shared = [topic for topic in RECORDED if topic not in OF_EACH]
        own["bag_recorder"] = {
            "topics": [
                *(topic.replace("/", f"/{who}/", 1) for who in people for topic in OF_EACH),
                *(*shared, "intent/active_person"),
            ]
        }
    if by_force:
        robot = with_fingers(find_robot(LWR)) if arm is None else arm.robot
        for node, felt in by_force_with(robot, hold_s).items():
            own[node] |= felt
    stands_m = np.array(list(STANDS_M.values()))
    scoring = Scoring(places_m, by_force=by_force, passed_m=stands_m)
    if arm is not None:
        scoring = scoring._replace(hand_of=arm.hand)
    return Scene(
        "bags/toolbox/train",
        "" if arm is None else "config/dofs_hand.yaml",
        "bags/sessions",
        "demo",
        named | {"task_list": ";".join(map(",".join, tasks.values()))},
        own,
        plans,
        {person: scoring._replace(places_m=own_m) for person, own_m in places.items()},
        "" if arm is None else _note(arm, reached_m),
    )


def _note(arm: "ToolboxArm", places_m: Floats) -> str:
    """What is assumed of the arm, and whether it is too short for places (n, 3) of its hand."""
    reached = arm.n_reached(places_m)
    short = (
        f"{arm.robot.tip} reaches {reached} of {len(places_m)} places: the arm stays at rest where"
        " it cannot reach. Name another --tip or --base, or a larger arm"
    )
    return "\n".join(filter(None, (arm.robot.note, short if reached < len(places_m) else "")))


def _assembly(args: argparse.Namespace) -> Scene:
    """Scene of the assembly: learned from two people, with the arm in the second one's place."""
    from sim_bridge.coworker import SessionTiming
    from sim_bridge.scenarios.assembly import REST_M, in_assistants_place, of_worker, plan_live
    from sim_bridge.scenarios.toolbox import Scoring

    if args.changes:
        cure = "Choose the scenario toolbox."
        raise ArgumentError.about("--changes", "0 with --scenario assembly", args.changes, cure)
    session = plan_live(args.seed, args.task_list, args.interactions or 0, SessionTiming())
    places_m = np.array([one.assistant[-1][1].goal_m for one in session.interactions])
    arm = _arm(args, REST_M, np.empty((0, 3)), fingers=False)
    named = arm_file(args, arm.robot)
    return Scene(
        "bags/assembly",
        "config/dofs_two_humans.yaml",
        "",
        "assembly",
        {"arm": named, "task_list": ",".join(one.task for one in session.interactions)},
        in_assistants_place(named, arm.robot.tip),
        {"": of_worker(session)},
        {"": Scoring(places_m, arm.hand, REST_M)},
        arm.robot.note,
    )


def _arm(args: argparse.Namespace, home_m: Floats, places_m: Floats, fingers: bool) -> "ToolboxArm":
    """The arm that the options name; one from a file stands where it reaches all places (n, 3)."""
    from sim_bridge.arm import NAMES, find_robot
    from sim_bridge.handover import with_fingers
    from sim_bridge.scenarios.toolbox import ToolboxArm

    fixed = args.arm in NAMES or not len(places_m)
    best, most, reason = None, -1, None
    for at in (None,) if fixed else BASES_M:
        robot = find_robot(args.arm, base=args.base, tip=args.tip, base_position_m=at)
        if fingers:
            robot = with_fingers(robot)
        arm = ToolboxArm(robot, home_m)
        try:
            _ = arm.home
        except KinematicsError as error:
            reason = reason or error
            continue
        reached = len(places_m) if fixed else arm.n_reached(places_m)
        if reached > most:
            best, most = arm, reached
        if most == len(places_m):
            break
    if best is None:
        cure = "Name another --tip or --base, or a larger arm."
        raise ArgumentError(f"--arm {args.arm}: its hand does not reach home. {reason} {cure}")
    return best


def arm_file(args: argparse.Namespace, robot: "Robot") -> str:
    """Description of the arm for the nodes: a name, or a URDF in which only this arm moves."""
    from sim_bridge.arm import NAMES

    if args.arm in NAMES and not (args.base or args.tip):
        return str(args.arm)
    path: Path = args.output / "arm.urdf"
    path.write_text(robot.source, encoding="utf-8")
    return str(path.resolve())
