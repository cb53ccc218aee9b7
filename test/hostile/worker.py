# SPDX-License-Identifier: Apache-2.0
"""Runs commands, each in a process with 1 GB and 20 s of computing; a line of JSON for each.

Forked, because a new interpreter for each of some 400 files would take five minutes.
"""

import gc
import json
import os
import pkgutil
import resource
import signal
import sys
import tempfile
import traceback
from pathlib import Path

MEMORY = 2**30
SECONDS = 20
WAITS = 10 * SECONDS
"""One that does not even compute is ended then [s]; a busy machine needs some of it."""


def open_tasks(path):
    from intent_recognition.demonstrations import load_dofs
    from intent_recognition.model.task_folder import TaskFolder

    TaskFolder(path, load_dofs()).history()


def find_arm(path):
    """As `intent demo --arm FILE` does before it learns."""
    from sim_bridge.arm import find_robot
    from sim_bridge.scenarios.toolbox import HOME_HAND_M, ToolboxArm

    _ = ToolboxArm(find_robot(path), HOME_HAND_M).home


def keep_clear(path):
    from intent_recognition.kinematics import Bodies, parse_boxes, read_chain

    text = Path(path).read_text(encoding="utf-8", errors="replace")
    names = read_chain(text, None, None, 1.0).names
    Bodies(text, names, parse_boxes(["box 1 0 0 0.1 0.1 0.1"]), clearance_m=0.02)


def simulate(path):
    from sim_bridge.arm import SimulatedArm, find_robot

    with SimulatedArm(None, robot=find_robot(path)) as arm:
        arm.step(10)


def read_sequences(path):
    from intent_recognition.composing import read_sequences
    from intent_recognition.untrusted import read_text

    read_sequences(read_text(Path(path)), ("plate_handover", "hold_screwdriver"))


def read_via_points(path, model):
    from intent_recognition.composing import check_via_points, read_via_points
    from intent_recognition.model import load_model
    from intent_recognition.untrusted import read_text

    check_via_points(load_model(model).library, read_via_points(read_text(Path(path))))


def read_boxes(path):
    from intent_recognition.kinematics import parse_boxes
    from intent_recognition.untrusted import load_yaml, read_text

    boxes = load_yaml(read_text(Path(path)))
    if isinstance(boxes, list):  # as a parameter of texts can be
        parse_boxes([str(box) for box in boxes])


CALLS = {
    "load_trained": "intent_recognition.model.file:load_trained",
    "load_pouring_skill": "intent_recognition.model:load_pouring_skill",
    "read_detector": "intent_recognition.nodes.activation_inputs:load_detector",
    "read_scene": "intent_recognition.dashboard.scene_file:load_scene",
}
"""Functions that take a path, imported when they are called."""
CALLS |= {"tasks": open_tasks, "find_arm": find_arm, "keep_clear": keep_clear, "simulate": simulate}
CALLS |= {call.__name__: call for call in (read_sequences, read_via_points, read_boxes)}


def run(words):
    """The exit code of a command, or of a function of `CALLS`."""
    from intent_recognition.cli.main import main
    from intent_recognition.errors import IntentError, one_line
    from intent_recognition.untrusted import UntrustedError

    if words[0] not in CALLS:
        return main(words)
    try:
        call = CALLS[words[0]]
        (pkgutil.resolve_name(call) if isinstance(call, str) else call)(*words[1:])
    except (IntentError, UntrustedError) as error:
        sys.stderr.write(f"{one_line(error)}\n")
        return 1
    return 0


def child(words, output):
    os.dup2(output, 1)
    os.dup2(output, 2)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
    signal.alarm(WAITS)
    code = 99
    try:
        code = run(words)
        sys.stdout.flush()
    except SystemExit as error:
        code = error.code if isinstance(error.code, int) else 1
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stderr.flush()
        os._exit(code)


def main():
    from few_functions import aligned_basis

    from intent_recognition.bags.definitions import jazzy_names
    from intent_recognition.cli import inspect, recover, train, warp  # noqa: F401
    from intent_recognition.errors import optional
    from intent_recognition.model import load_model  # noqa: F401
    from sim_bridge.arm import find_robot  # noqa: F401
    from sim_bridge.scenarios.toolbox import ToolboxArm  # noqa: F401

    optional("pinocchio")
    optional("trimesh")
    jazzy_names()
    gc.collect()
    gc.freeze()  # children share what is there

    with aligned_basis():
        for line in sys.stdin:
            words = json.loads(line)
            with tempfile.TemporaryFile() as output:
                pid = os.fork()
                if pid == 0:
                    child(words, output.fileno())
                _, status, used = os.wait4(pid, 0)
                output.seek(0)
                text = output.read(200_000).decode(errors="replace")
            answer = {
                "code": os.waitstatus_to_exitcode(status),
                "text": text,
                "seconds": used.ru_utime + used.ru_stime,
                "megabytes": used.ru_maxrss / 1000,
            }
            print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main()
