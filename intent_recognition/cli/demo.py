# SPDX-License-Identifier: Apache-2.0
"""Train on the shipped bags, start the nodes as separate processes, and let a simulated coworker
assemble a toolbox with the arm's help. Needs ROS 2.

what happens:
--scenario         toolbox (default): hand over parts; cell: two people, one work plan of 20 steps,
                   boxes in the arm's way; assembly: the arm replaces the second of two people;
                   pouring: --interactions pours (default: 2) between containers it was not taught
                   with
--pour AMOUNT      amount to pour: empty (default), full or millilitres
--pair CUP,SECOND  pour between these containers only, such as tea_cup,paper_cup
--task-list F      labels separated by commas, 'rest' to wait, OLD>NEW@SHARE for a reach whose goal
                   changes, a file of them, 'habit' (default: the usual order, with variation) or
                   'random'
--interactions N   number of interactions (default: as in the list; 40 with habit or random)
--changes N        the coworker changes to another task in N of them (default: 0)
--arm ARM          lwr (default), panda, iiwa, xarm, or the path of a URDF or xacro file; other arms
                   move their hands as the LWR was taught. Several, separated by commas, run in
                   turn
--tip LINK         the arm's hand, where there are two arms (default: the end of the branch with the
                   most joints, before the gripper)
--base LINK        where the arm begins: joints before it, such as a lift, are held at zero
                   (default: the root)
--transfers        fingers and the worker's hand hold objects by force; else hands are empty
                   (default: unless --arm is a path)
--seed SEED        random seed of the session (default: 1)
--sequences F      YAML file of sequences, in which the arm may begin a step by itself
--params F         ROS 2 parameter file (YAML) that overrides the demo's parameters
--no-anticipation  ignore the usual order of tasks and never act in advance
--rate X           speed of simulated time; 1 is real time (default: 1.5, with --dashboard 1.0)
--model M.npz      use this model (pouring: this skill) instead of training one
--recordings BAGS  play the people of these recordings in real time instead of the coworker, with
                   the --model learned from such recordings

what is shown:
--dashboard  serve a page that shows the cell and teaches tasks, until Ctrl-C
--port PORT  port of the page (default: %(default)s)
--headless   no window of the simulation

what is written:
--output DIR  folder of model, report and logs (default: %(default)s)
--record BAG  record the session to a bag
--json OUT    all numbers

# with a page to watch it, and to teach it tasks
intent demo --dashboard
# a short one without a window
intent demo --headless --interactions 5 --seed 2
# keep the session and its numbers
intent demo --headless --record out/session --json out/numbers.json
# the coworker changes to another task in ten of forty interactions
intent demo --headless --changes 10
# another arm does what the LWR was taught
intent demo --arm panda
# the left arm of a robot with two arms
intent demo --arm robot.urdf --base torso --tip left_gripper
# four arms, and one report of all
intent demo --arm lwr,panda,iiwa,xarm
# two people, a work plan, and boxes on the way
intent demo --scenario cell --arm panda
# the arm replaces one of two people
intent demo --scenario assembly --arm panda
# a sequence of parts, which the arm continues by itself
intent demo --sequences config/examples/toolbox_sequence.yaml --headless
  --task-list plate_handover,plate_handover,screw_handover
# recorded people, and a model of your own
intent demo --arm panda --dashboard --model mine.npz --recordings held_out
# the arm pours with other cups and bowls
intent demo --scenario pouring
# only 25 millilitres
intent demo --scenario pouring --pour 25
"""

import argparse
import socket
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table

from intent_recognition.cli.console import say
from intent_recognition.cli.demo_model import check_model, trained_model
from intent_recognition.cli.demo_scene import LIVE, Scene, make_scene
from intent_recognition.cli.demo_session import refuse_options, run_session
from intent_recognition.cli.options import number
from intent_recognition.cli.output import console_beside, table_console, write_json
from intent_recognition.composing import read_sequences
from intent_recognition.errors import ArgumentError, ResourceBusyError
from intent_recognition.interrupts import END_SIGNALS, end_like_interrupted
from intent_recognition.model import load_model, load_trained
from intent_recognition.untrusted import read_named

if TYPE_CHECKING:
    from intent_recognition.evaluation import InteractionRecord

SCENARIOS = (*LIVE, "pouring")


OPTIONS = {
    "scenario": {"choices": SCENARIOS, "default": "toolbox"},
    "pour": {"default": "empty"},
    "task_list": {"default": "habit", "type": str},
    "interactions": {"type": number(int, 1), "default": 0},
    "changes": {"type": number(int, 0), "default": 0},
    "arm": {"default": "lwr"},
    "tip": {"default": ""},
    "base": {"default": ""},
    "transfers": {"action": argparse.BooleanOptionalAction, "default": None},
    "seed": {"type": number(int, 0), "default": 1},
    "rate": number(float, 0.01, 50.0),
    "port": {"type": number(int, 1, 65535), "default": 8080},
    "output": {"default": Path("out/demo")},
}


def run(args: argparse.Namespace) -> int:
    """Run the demo; 1 if a node died or more than one interaction in forty was missed."""
    console = console_beside(args)
    import rclpy  # noqa: F401  fails before any training

    end_like_interrupted(*END_SIGNALS)
    if args.recordings is not None:
        from intent_recognition.cli.demo_recordings import run_recordings

        _check(args)
        return run_recordings(args, console)
    if args.rate is None:
        args.rate = 1.0 if args.dashboard else 1.5
    if args.scenario == "pouring":
        from intent_recognition.cli.demo_pouring import run_pouring

        return run_pouring(args, console)
    arms = args.arm.split(",")
    if len(arms) > 1:
        return _run_several(args, arms, console)
    _check(args)
    scene = make_scene(args)
    records, numbers = _run_one(args, scene, console)
    write_json(args.json, numbers)
    return _end(records, console)


def _run_several(args: argparse.Namespace, arms: list[str], console: Console) -> int:
    """Run the same session with one arm after another, and write one report of all."""
    from intent_recognition.report import arms_page, write_page

    alone = {"record": None, "dashboard": False, "model": None, "tip": "", "base": ""}
    refuse_options(args, alone, "several arms", "Run one arm at a time.")
    own = [{"arm": arm, "output": args.output / Path(arm).stem} for arm in arms]
    if len({part["output"] for part in own}) < len(arms):
        cure = "Write each once, or rename a file."
        raise ArgumentError.about("--arm", "arms of different names", args.arm, cure)
    parts = [argparse.Namespace(**vars(args) | values) for values in own]
    for part in parts:
        _check(part)
    scenes = [make_scene(part) for part in parts]
    sessions, numbers = {}, {}
    for part, scene in zip(parts, scenes, strict=True):
        say(console, f"arm: {part.arm}")
        sessions[part.arm], numbers[part.arm] = _run_one(part, scene, console)
    report = write_page(args.output / "report.html", arms_page(sessions))
    say(console, f"all arms: {report}")
    write_json(args.json, {"arms": numbers})
    return _end([record for records in sessions.values() for record in records], console)


def _end(records: list["InteractionRecord"], console: Console) -> int:
    """Print the last line; returns the exit code."""
    from intent_recognition.evaluation import summarise, summary_line

    summary = summarise(records)
    say(console, summary_line(summary))
    return 1 if summary.too_many_missed else 0


def _check(args: argparse.Namespace) -> None:
    """Check before the training whatever could stop the demo after it."""
    of_pouring = {"pour": "empty", "pair": None}
    refuse_options(args, of_pouring, f"--scenario {args.scenario}", "Add --scenario pouring.")
    if args.scenario != "toolbox":
        beside = f"--scenario {args.scenario}"
        refuse_options(args, {"transfers": None}, beside, "Leave one of them out.")
    try:
        args.output.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ResourceBusyError.about(
            "--output", "a folder that can be made", args.output, "Choose another."
        ) from error
    if args.params is not None and not args.params.is_file():
        cure = "Write its path."
        raise ArgumentError.about("--params", "a YAML file", args.params, cure)
    if args.sequences is not None:
        read_named(args.sequences, "--sequences", "Write its path.", read_sequences)
    if args.model is not None:
        (load_trained if args.dashboard else load_model)(args.model)
    if args.dashboard:
        with socket.socket() as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind(("127.0.0.1", args.port))
            except OSError as error:
                cure = "Choose another --port, or end the program that has it."
                raise ResourceBusyError.about("--port", "a free port", args.port, cure) from error


def _run_one(
    args: argparse.Namespace, scene: Scene, console: Console
) -> tuple[list["InteractionRecord"], dict]:
    """Run one session, print its table and write its report; return its records and numbers."""
    from intent_recognition.evaluation import summarise, to_json
    from intent_recognition.report import demo_page, write_page
    from sim_bridge.scenarios.toolbox import score_people

    if scene.note:
        say(console, scene.note)
    if args.model is not None:
        check_model(args.model, scene)
    model = args.model or trained_model(args.output / "model.npz", console, scene)
    logs, first_ns, time_went = run_session(args, model, console, scene)
    records, traces = score_people(logs, scene.plans, first_ns, scene.scorings)
    summary = summarise(records)
    duration_s = max(float(plan.samples.times_s[-1]) for plan in scene.plans.values())
    settings = {
        "scenario": args.scenario,
        "arm": args.arm,
        "seed": args.seed,
        "objects change hands": "by force" if scene.arguments.get("transfers") else "not",
        "simulated time per real time, asked for": args.rate,
        **time_went,
        "duration of the session [s, simulated]": round(duration_s, 1),
    }
    table_console(args).print(table_of(records))
    report = args.output / "report.html"
    say(console, "drawing the report ...")
    write_page(report, demo_page(records, summary, traces, settings))
    say(console, f"session of {duration_s:.0f} s in simulated time, report: {report}")
    return records, to_json(records, summary, settings)


def table_of(records: Sequence["InteractionRecord"]) -> Table:
    """A table with one row per interaction, 80 columns wide; the report has further columns."""
    from intent_recognition.report import fields_of

    fields = [field for field in fields_of(records) if field.title != "movement"]
    table = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0), header_style="bold")
    for field in fields:
        title = field.title.replace(" ", "\n").replace("observations", "obser-\nvations")
        title += f"\n[{field.unit}]" if field.unit else ""
        words = " ".join([title, *(field.cell(record) or "" for record in records)]).split()
        number = field.align == "right"
        longest = max(map(len, words))
        table.add_column(title, justify=field.align, no_wrap=number, min_width=longest)
    for record in records:
        table.add_row(*(field.cell(record) or "-" for field in fields))
    return table
