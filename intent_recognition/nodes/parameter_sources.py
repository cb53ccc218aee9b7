# SPDX-License-Identifier: Apache-2.0
"""Where a node's parameters come from: which file, the command line, or its own defaults."""

import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import yaml

DEFAULT = "default"
COMMAND_LINE = "command line"
LAUNCH = "launch argument"
_LAUNCH_FILE = "launch_params_"
"""How launch_ros begins the name of the file into which it writes values of arguments."""


def parameter_sources(arguments: Sequence[str], node: str) -> dict[str, str]:
    """Where each parameter given to a node on its command line was set last.

    Args:
        arguments: the process's own, with `--ros-args ... --params-file F -p name:=value`.
        node: full name of the node, with its namespace.

    Returns:
        Parameter name to a file's path, `COMMAND_LINE` or `LAUNCH`. A parameter that is not here
        has its default. Files that cannot be read are passed over: rcl refuses them itself.
    """
    sources: dict[str, str] = {}
    options = list(arguments)
    if "--ros-args" in options:
        options = options[options.index("--ros-args") + 1 :]
    for option, value in pairwise(options):
        if option == "--params-file":
            shown = LAUNCH if Path(value).name.startswith(_LAUNCH_FILE) else value
            sources |= dict.fromkeys(_names(value, node), shown)
        elif option in ("-p", "--param") and ":=" in value:
            *of, name = value.split(":=", 1)[0].split(":")
            if not of or of[0].strip("/") == node.rsplit("/", 1)[-1]:
                sources[name] = COMMAND_LINE
    return sources


def _names(path: str, node: str) -> list[str]:
    """Parameters that a file sets for a node."""
    try:
        content = yaml.safe_load(Path(path).read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError):
        return []
    return [
        name
        for section, values in sections(content, "")
        if holds_for(section, node)
        for name in values
    ]


def sections(content: Any, prefix: str) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Names of nodes with their parameters; names may be nested, namespace by namespace."""
    if not isinstance(content, Mapping):
        return
    for key, value in content.items():
        if key == "ros__parameters" and isinstance(value, Mapping):
            yield prefix, value
        else:
            yield from sections(value, f"{prefix}/{str(key).strip('/')}")


def holds_for(section: str, node: str) -> bool:
    """Whether a section holds for a node; `*` is one name, `**` any number of them."""
    parts = {"**": r"(/[^/]+)*", "*": r"/[^/]+"}
    pattern = "".join(parts.get(p, "/" + re.escape(p)) for p in section.strip("/").split("/"))
    return re.fullmatch(pattern, node) is not None
