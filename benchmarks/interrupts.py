# SPDX-License-Identifier: Apache-2.0
"""Ctrl-C at any instant: each node's executable and `intent demo`, 0.2 to 6 s after their start.

    python -m benchmarks.interrupts [--times 20] [--only NAME...]

Each must end by itself with its exit code (0 for a node, 130 for a command), without a traceback.
An interrupt while Python itself starts, before the first line of ours, is counted apart: it leaves
Python's own traceback, or is lost where the wheels of ROS 2 start Python a second time.
"""

import argparse
import os
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np

from intent_recognition.demonstrations import load_dofs, read_demonstrations
from intent_recognition.interrupts import INTERRUPTED
from intent_recognition.learning import learn
from intent_recognition.model import Model, save_model
from intent_recognition.registry import NODES
from intent_recognition.share import share_path

FIRST_S, LAST_S = 0.2, 6.0
LONGEST_S = 60.0
"""A process that has not ended this long after the interrupt [s] hangs."""
DOMAIN = 52


class Ended(NamedTuple):
    """How a process ended that was interrupted."""

    code: int | None
    errors: str

    def fault(self, expected: int) -> str:
        """What is wrong with that; empty for nothing."""
        if "Traceback" in self.errors:
            return "traceback: " + self.errors.strip().splitlines()[-1]
        if self.code is None:
            return "hangs"
        return "" if self.code == expected else f"code {self.code}"


def needed(folder: Path) -> dict[str, tuple[str, ...]]:
    """Parameters without which nodes do not start, by node; a model is learned for that."""
    dofs, model = load_dofs(), folder / "model.npz"
    found, _ = read_demonstrations(sorted(share_path("bags/toolbox/train").iterdir())[::6], dofs)
    save_model(model, Model(learn(found), dofs))
    bag = share_path("bags/toolbox/test/plate_handover_00")
    return {
        "intent_estimator": (f"model:={model}",),
        "primitive_activation": (f"model:={model}",),
        "task_teacher": (f"library:={folder / 'tasks'}",),
        "dashboard": ("port:=8977", f"models:={folder}"),
        "bag_player": (f"bag:={bag}", "start_paused:=true"),
        "bag_recorder": ("topics:=[joint_states]",),
    }


def commands(needs: Mapping[str, Sequence[str]] | None = None) -> dict[str, tuple[list[str], int]]:
    """Command line and expected exit code, by name; with parameters by node."""
    bin_directory, found = Path(sys.executable).parent, {}
    for name in NODES:
        parameters = [word for one in (needs or {}).get(name, ()) for word in ("-p", one)]
        found[name] = ([str(bin_directory / name), "--ros-args", *parameters], 0)
    demo = [str(bin_directory / "intent"), "demo", "--headless", "--seed", "1"]
    return {**found, "intent demo": (demo, INTERRUPTED)}


def interrupted(command: Sequence[str], after_s: float) -> Ended:
    """Start a command, interrupt it as a terminal does, and wait for its end."""
    process = subprocess.Popen(
        command,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env={**os.environ, "ROS_DOMAIN_ID": str(DOMAIN)},
    )
    time.sleep(after_s)
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGINT)
    try:
        _, errors = process.communicate(timeout=LONGEST_S)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        return Ended(None, process.communicate()[1])
    return Ended(process.returncode, errors)


def main() -> int:
    """Print a line for each executable; the exit code is 1 where one did not end well."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--times", type=int, default=20, help="interrupts of each")
    parser.add_argument("--only", nargs="+", metavar="NAME", help="some of them")
    args = parser.parse_args()
    # As a terminal: a shell lets what runs in the background ignore SIGINT, and all that it starts.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    with TemporaryDirectory() as folder:
        found = commands(needed(Path(folder)))
        names = [name for name in found if not args.only or name in args.only]
        return max([_try(name, *found[name], args.times) for name in names])


def _try(name: str, command: Sequence[str], expected: int, times: int) -> int:
    """Interrupt an executable so many times, print what came of it, and return 1 for a fault."""
    early, faults, starts_s = 0, [], started_s()
    for after_s in np.geomspace(FIRST_S, LAST_S, times):
        fault = interrupted(command, after_s).fault(expected)
        if fault and after_s <= starts_s:
            early += 1
        elif fault:
            faults.append(f"{after_s:.2f} s: {fault}")
    apart = f", {early} more while Python started ({starts_s:.2f} s)" if early else ""
    well = times - early - len(faults)
    print(f"{name}: {well} of {times - early}{apart}", *faults, sep="\n  ", flush=True)
    return int(bool(faults))


def started_s() -> float:
    """A bound on the time that Python takes to its first line [s]: twice the worst of three."""
    measured = []
    for _ in range(3):
        begun_s = time.perf_counter()
        subprocess.run([sys.executable, "-c", ""], check=True)
        measured.append(time.perf_counter() - begun_s)
    return 2.0 * max(measured)


if __name__ == "__main__":
    sys.exit(main())
