# SPDX-License-Identifier: Apache-2.0
"""Declaration of a node's parameters with type, range and description, and sources of values."""

import math
import re
import sys
import weakref
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import yaml
from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.parameter import Parameter

from intent_recognition.errors import ArgumentError, IntentError, nearest, one_line
from intent_recognition.parameter_table import ParameterSpec, parameter_parts

Changes = Mapping[str, Any]
"""New values by parameter name; each has the type it was declared with."""

_EXPECTED = {
    Parameter.Type.BOOL: "true or false",
    Parameter.Type.INTEGER: "a whole number",
    Parameter.Type.DOUBLE: "a number",
    Parameter.Type.STRING: "a text",
    Parameter.Type.DOUBLE_ARRAY: "a list of numbers",
    Parameter.Type.STRING_ARRAY: "a list of texts",
}

_checked: weakref.WeakSet[Node] = weakref.WeakSet()
"""Nodes that already refuse NaN and infinity."""


def declare(node: Node, part: str) -> dict[str, Any]:
    """Declare the parameters of a part of a node, and return their values by name.

    Parameters that are already declared keep their values.

    Returns:
        The values, with overrides applied. Integers given for floats (`rate:=0`) become floats; an
        array becomes a Python list, and an unset one `[]`.

    Raises:
        ArgumentError: an override has the wrong type, is not finite, or is not an allowed value.
    """
    specs = parameter_parts()[part]
    for name, spec in specs.items():
        if not node.has_parameter(name):
            declare_one(node, name, spec)
    return {name: plain(node.get_parameter(name).value) for name in specs}


def declare_one(node: Node, name: str, spec: ParameterSpec) -> Any:
    """Declare a parameter, and return its value; see `declare`.

    Its type is dynamic at first, so that an integer can be taken for a float, and then fixed.
    """
    if node not in _checked:
        _checked.add(node)
        node.add_on_set_parameters_callback(_refuse_not_finite)
    kind = Parameter.Type[spec.kind.upper()]
    if spec.default != []:
        kind = Parameter.Type.from_parameter_value(spec.default)
    try:
        any_type = ParameterDescriptor(dynamic_typing=True)
        given = plain(node.declare_parameter(name, spec.default, any_type).value)
        off = given is False and "off" in spec.one_of  # so YAML reads the word off
        value = "off" if off else _converted(given, kind)
        if not kind.check(value):
            listed = kind.name.endswith("ARRAY") and not isinstance(given, list)
            cure = f"Give {name}:=[{given}]." if listed else spec.description
            raise ArgumentError.about(f"parameter {name}", _EXPECTED[kind], repr(given), cure)
        node.set_parameters([Parameter(name, kind, value)])
        node.set_descriptor(name, _descriptor(kind, spec))
    except ArgumentError:
        raise
    except (ParameterException, TypeError, ValueError) as error:
        raise ArgumentError(f"parameter {name}: {one_line(error)}. {spec.description}") from error
    if spec.one_of and value not in spec.one_of:
        expected = f"one of {', '.join(spec.one_of)}"
        raise ArgumentError.about(f"parameter {name}", expected, given, "Choose one of them.")
    return plain(node.get_parameter(name).value)


def live_parameters(part: str) -> list[str]:
    """Names of the parameters of a part that may change while the node runs."""
    return [name for name, spec in parameter_parts()[part].items() if spec.live]


def plain(value: Any) -> Any:
    """A parameter's value; arrays as lists, and `[]` for an unset one."""
    if value is None:
        return []
    return value if isinstance(value, (str, bool, int, float)) else list(value)


def keep_live(
    node: Node,
    names: Iterable[str],
    check: Callable[[Changes], object],
    apply: Callable[[Changes], object],
) -> None:
    """Let parameters of a node change while it runs.

    rclpy refuses wrong types, values out of range and read-only parameters; `declare` has NaN and
    infinity refused. `check` raises an IntentError if values do not fit together, and changes
    nothing; `apply` puts values in force.
    """
    known = frozenset(names)

    def select(parameters: list[Parameter]) -> dict[str, Any]:
        return {p.name: plain(p.value) for p in parameters if p.name in known}

    def on_set(parameters: list[Parameter]) -> SetParametersResult:
        changes = select(parameters)
        try:
            if changes:
                check(changes)
        except IntentError as error:
            return SetParametersResult(successful=False, reason=one_line(error))
        return SetParametersResult(successful=True)

    def after_set(parameters: list[Parameter]) -> None:
        changes = select(parameters)
        if changes:
            apply(changes)
            shown = ", ".join(f"{name} {value}" for name, value in changes.items())
            node.get_logger().info(f"changed: {shown}")

    node.add_on_set_parameters_callback(on_set)
    node.add_post_set_parameters_callback(after_set)


def _converted(value: Any, kind: Parameter.Type) -> Any:
    """Take `rate:=1` for 1.0 and `home:=[0, 0]` for [0.0, 0.0]; rclpy would refuse both."""
    if kind is Parameter.Type.DOUBLE and type(value) is int:
        return float(value)
    if kind is Parameter.Type.DOUBLE_ARRAY and isinstance(value, list):
        return [float(v) if type(v) is int else v for v in value]
    return value


def _descriptor(kind: Parameter.Type, spec: ParameterSpec) -> ParameterDescriptor:
    descriptor = ParameterDescriptor(
        type=kind.value, description=spec.description, read_only=not spec.live
    )
    if spec.minimum is None and spec.maximum is None:
        return descriptor
    whole, most = not isinstance(spec.default, float), sys.float_info.max
    low = (-(2**63) if whole else -most) if spec.minimum is None else spec.minimum
    high = (2**63 - 1 if whole else most) if spec.maximum is None else spec.maximum
    if whole:
        limits = IntegerRange(from_value=int(low), to_value=int(high), step=1)
        descriptor.integer_range = [limits]
    else:
        between = FloatingPointRange(from_value=float(low), to_value=float(high), step=0.0)
        descriptor.floating_point_range = [between]
    return descriptor


def _refuse_not_finite(parameters: list[Parameter]) -> SetParametersResult:
    """Refuse NaN and infinity at run time; a range alone would accept NaN."""
    for changed in parameters:
        is_array = changed.type_ == Parameter.Type.DOUBLE_ARRAY
        values = changed.value if is_array else [changed.value]
        if any(isinstance(value, float) and not math.isfinite(value) for value in values):
            reason = f"parameter {changed.name}: expected finite numbers, got {changed.value}"
            return SetParametersResult(successful=False, reason=reason)
    return SetParametersResult(successful=True)


DEFAULT = "default"
COMMAND_LINE = "command line"
LAUNCH = "launch argument"


def parameter_sources(arguments: Sequence[str], node: str) -> dict[str, str]:
    """Where each parameter given to a node on its command line was set last.

    Args:
        arguments: those of the process, with `--ros-args ... --params-file F -p name:=value`.
        node: full name of the node, with its namespace.

    Returns:
        Parameter name to a file's path, `COMMAND_LINE` or `LAUNCH`. Parameters with their default
        are missing. Files that cannot be read are ignored: rcl refuses them itself.
    """
    sources: dict[str, str] = {}
    options = list(arguments)
    if "--ros-args" in options:
        options = options[options.index("--ros-args") + 1 :]
    for option, value in pairwise(options):
        if option == "--params-file":
            of_launch = Path(value).name.startswith("launch_params_")  # so launch_ros names them
            shown = LAUNCH if of_launch else value
            sources |= dict.fromkeys(_names(value, node), shown)
        elif option in ("-p", "--param") and ":=" in value:
            *target, name = value.split(":=", 1)[0].split(":")
            if not target or target[0].strip("/") == node.rsplit("/", 1)[-1]:
                sources[name] = COMMAND_LINE
    return sources


def check_given(node: Node, arguments: Sequence[str]) -> None:
    """Refuse parameters of a command line that a node has not declared."""
    known = node.get_parameters_by_prefix("")
    for name, source in parameter_sources(arguments, node.get_fully_qualified_name()).items():
        of_topic = name.partition(".")[0] == "qos_overrides"  # declared with each topic
        if source == COMMAND_LINE and name not in known and not of_topic:
            cure = nearest(name, known, f"They are {', '.join(sorted(known))}.")
            raise ArgumentError.about("-p", "a parameter of the node", name, cure)


def _names(path: str, node: str) -> list[str]:
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
    """Names of nodes and their parameters in a file, where names may be nested by namespace."""
    if not isinstance(content, Mapping):
        return
    for key, value in content.items():
        if key == "ros__parameters" and isinstance(value, Mapping):
            yield prefix, value
        else:
            yield from sections(value, f"{prefix}/{str(key).strip('/')}")


def holds_for(section: str, node: str) -> bool:
    """Whether a section applies to a node; `*` matches one name, `**` any number of names."""
    parts = {"**": r"(/[^/]+)*", "*": r"/[^/]+"}
    pattern = "".join(parts.get(p, "/" + re.escape(p)) for p in section.strip("/").split("/"))
    return re.fullmatch(pattern, node) is not None
