# SPDX-License-Identifier: Apache-2.0
"""Runs commands, each in a process of its own that has 1 GB and 20 s; one line of JSON for each.

Forked, because a new interpreter for each of 500 files would take five minutes.
"""

import json
import os
import resource
import signal
import sys
import tempfile
import traceback

MEMORY = 2**30
SECONDS = 20


def load_all_of_a_model(path):
    from intent_recognition.model.file import load_trained

    load_trained(path)


def open_tasks(path):
    from intent_recognition.demonstrations import load_dofs
    from intent_recognition.model.task_folder import TaskFolder

    TaskFolder(path, load_dofs()).history()


def load_skill(path):
    from intent_recognition.model import load_pouring_skill

    load_pouring_skill(path)


CALLS = {"load_trained": load_all_of_a_model, "tasks": open_tasks, "load_pouring_skill": load_skill}


def run(words):
    """The exit code of a command, or of a function of `CALLS`."""
    from intent_recognition.cli.main import main
    from intent_recognition.errors import IntentError, one_line

    if words[0] not in CALLS:
        return main(words)
    try:
        CALLS[words[0]](*words[1:])
    except IntentError as error:
        sys.stderr.write(f"{one_line(error)}\n")
        return 1
    return 0


def child(words, output):
    os.dup2(output, 1)
    os.dup2(output, 2)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    signal.alarm(SECONDS)
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
    from intent_recognition.cli import inspect, recover, train, warp  # noqa: F401
    from intent_recognition.model import load_model  # noqa: F401

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
