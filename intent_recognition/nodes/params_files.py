# SPDX-License-Identifier: Apache-2.0
"""Parameter files of a launch: where they are, and what they give to a node."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from intent_recognition.errors import ArgumentError, IntentError
from intent_recognition.nodes.graph import GRAPHS, NodeCall
from intent_recognition.nodes.parameters import holds_for, sections
from intent_recognition.share import share_path
from intent_recognition.untrusted import load_yaml, read_named


def params_files(graph: str, values: Mapping[str, object]) -> list[str]:
    """Paths of the shipped parameter file of a graph and of the user's, if one is given.

    Raises:
        ArgumentError: there is no such file.
    """
    users = [_path(str(values["params_file"]))] if "params_file" in values else []
    return [str(share_path(GRAPHS[graph].params)), *users]


def parameters_in(files: Sequence[str], call: NodeCall) -> dict[str, object]:
    """Parameters that files give to a node; a later file overrides.

    Raises:
        ArgumentError: a file cannot be read.
    """
    found: dict[str, object] = {}
    for file in files:
        content = read_named(Path(file), "params_file", "Correct the file.", load_yaml)
        for section, values in sections(content, ""):
            if holds_for(section, call.enclave):
                found |= values
    return found


def _path(name: str) -> str:
    if Path(name).is_file():
        return str(Path(name).absolute())
    try:
        return str(share_path(name))
    except IntentError as error:
        cure = "Give the path of yours, or the name of a shipped one, such as config/real_arm.yaml."
        got = f"{Path(name).absolute()}, which is not a file"
        raise ArgumentError.about("params_file", "a file", got, cure) from error
