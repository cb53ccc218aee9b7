# SPDX-License-Identifier: Apache-2.0
"""Nodes as child processes that end with the command that started them; their environment."""

import ctypes
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, suppress
from functools import partial
from pathlib import Path

from intent_recognition.errors import IntentError
from intent_recognition.share import share_path

PROFILES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
"""Variables with the profiles of Fast DDS: the one of Jazzy, and the one of later distributions."""
RANGE, LOCALHOST = "ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST"
"""Variable with the range of discovery, and its value for this machine alone."""
MIDDLEWARE, FAST_DDS, PEERS = "RMW_IMPLEMENTATION", "rmw_fastrtps", "ROS_STATIC_PEERS"
"""Variable with the middleware, prefix of those that read profiles of Fast DDS, and variable with
other machines on which nodes are looked for, too."""
STOP_S = 5.0
"""Time that nodes get to end after each signal, before the next one [s]; as in ROS 2 launch."""


def node_environment(base: Mapping[str, str], domain_id: int | None = None) -> dict[str, str]:
    """Environment in which node processes of this machine find one another quickly.

    Variables that are set in `base` keep their values, except the domain, if one is given, and
    those that `transport` sets.
    """
    environment = {"AMENT_PREFIX_PATH": sys.prefix, RANGE: LOCALHOST, **base}
    environment |= transport(environment)
    if domain_id is not None:
        environment["ROS_DOMAIN_ID"] = str(domain_id)
    return environment


def transport(base: Mapping[str, str]) -> dict[str, str]:
    """Variables to add to `base`, so that nodes find one another quickly, also after a restart.

    None are added if `base` names profiles of Fast DDS. Shared memory is left out
    (docs/decisions/transport.md). rmw_fastrtps always adds it to the range LOCALHOST, so profiles
    replace that range. The range stays if other machines are named, or with another middleware,
    which would not read the profiles and would look for nodes on the network.
    """
    if any(base.get(name) for name in PROFILES):
        return {}
    reads_profiles = (base.get(MIDDLEWARE) or FAST_DDS).startswith(FAST_DDS)
    if base.get(RANGE) != LOCALHOST or base.get(PEERS) or not reads_profiles:
        return dict.fromkeys(PROFILES, str(share_path("config/fastdds.xml")))
    within = dict.fromkeys(PROFILES, str(share_path("config/fastdds_localhost.xml")))
    return {**within, RANGE: "SYSTEM_DEFAULT"}


class NodeProcesses(AbstractContextManager["NodeProcesses"]):
    """Starts nodes, checks that they run, and stops them all at the end of the block.

    Each node runs in a session of its own, so that Ctrl-C in the terminal reaches only the parent,
    which stops them in order. On Linux the kernel ends them if the parent is killed.
    """

    def __init__(self, environment: Mapping[str, str], log_folder: Path):
        self._environment = dict(environment)
        self._log_folder = log_folder
        self._processes: dict[str, subprocess.Popen] = {}
        log_folder.mkdir(parents=True, exist_ok=True)

    def __exit__(self, *_: object) -> None:
        self.stop()

    def start(
        self,
        name: str,
        module: str,
        parameters: Mapping[str, object],
        remappings: Sequence[tuple[str, str]] = (),
        params_file: Path | None = None,
    ) -> None:
        """Start the node `main` of `module` with parameters (text, numbers, lists)."""
        quietly = "from intent_recognition.interrupts import end_node_at_interrupts as e; e();"
        code = f"{quietly} import sys, {module} as m; sys.exit(m.main())"
        command = [sys.executable, "-c", code]
        command += ["--ros-args"]
        for key, value in parameters.items():
            command += ["-p", f"{key}:={yaml_value(value)}"]
        if params_file is not None:
            command += ["--params-file", str(params_file.resolve())]
        for pair in (("__node", name), *remappings) if remappings else ():
            command += ["-r", ":=".join(pair)]
        with self.log_file(name).open("w", encoding="utf-8") as log:
            self._processes[name] = subprocess.Popen(
                command,
                env=self._environment,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                start_new_session=True,
                preexec_fn=partial(_die_with, os.getpid()) if sys.platform == "linux" else None,
            )

    @property
    def names(self) -> list[str]:
        """Names of all nodes that were started."""
        return list(self._processes)

    def log_file(self, name: str) -> Path:
        """File with a node's output."""
        return self._log_folder / f"{name}.log"

    def pid(self, name: str) -> int:
        """Process number of a node."""
        return self._processes[name].pid

    def running(self, name: str) -> bool:
        """Whether a node still runs."""
        return self._processes[name].poll() is None

    def check(self, may_end: Sequence[str] = ()) -> None:
        """Check that all nodes run; those in `may_end` may have ended with exit code 0.

        Raises:
            IntentError: a node has died; the end of its log is in the message.
        """
        for name, process in self._processes.items():
            code = process.poll()
            if code is None or (name in may_end and code == 0):
                continue
            lines = self.log_file(name).read_text(encoding="utf-8", errors="replace").splitlines()
            got = f"exit code {code}: {' | '.join(lines[-5:]) or 'no output'}"
            cure = f"See {self.log_file(name)}."
            raise IntentError.about(f"node {name}", "a process that runs until the end", got, cure)

    def stop(self) -> None:
        """Interrupt all nodes, wait, and kill what is left."""
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):
            alive = [p for p in self._processes.values() if p.poll() is None]
            for process in alive:
                process.send_signal(number)
            deadline = time.monotonic() + STOP_S
            for process in alive:
                with suppress(subprocess.TimeoutExpired):
                    process.wait(max(0.0, deadline - time.monotonic()))
        self._processes.clear()


def yaml_value(value: object) -> str:
    """A parameter as YAML that keeps its type: texts and paths quoted, floats with a point."""
    return json.dumps(value, ensure_ascii=False, default=os.fspath)


def _die_with(parent: int) -> None:
    """Ask the kernel to end this process with its parent (in the child, before exec)."""
    ctypes.CDLL(None).prctl(1, signal.SIGTERM)  # PR_SET_PDEATHSIG of prctl(2)
    if os.getppid() != parent:  # it has ended already
        os._exit(1)
