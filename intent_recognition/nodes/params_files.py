# SPDX-License-Identifier: Apache-2.0
"""Parameter files of a launch: where they are, and what they give to a node."""

from pathlib import Path

from intent_recognition.errors import ArgumentError, IntentError
from intent_recognition.nodes.graph import NodeCall
from intent_recognition.nodes.parameters import holds_for, sections
from intent_recognition.share import share_path
from intent_recognition.untrusted import load_yaml, read_named


def section_of(file: str, call: NodeCall) -> dict[str, object]:
    """Parameters in a file for a node."""
    content = read_named(Path(file), "params_file", "Correct the file.", load_yaml)
    found: dict[str, object] = {}
    for section, values in sections(content, ""):
        if holds_for(section, call.enclave):
            found |= values
    return found


def params_path(name: str) -> str:
    """Path of a parameter file, the user's or a shipped one.

    Raises:
        ArgumentError: there is no such file.
    """
    if Path(name).is_file():
        return str(Path(name).absolute())
    try:
        return str(share_path(name))
    except IntentError as error:
        cure = "Give the path of yours, or the name of a shipped one, such as config/real_arm.yaml."
        got = f"{Path(name).absolute()}, which is not a file"
        raise ArgumentError.about("params_file", "a file", got, cure) from error
