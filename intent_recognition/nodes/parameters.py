# SPDX-License-Identifier: Apache-2.0
"""Parameters of a node: declared with type, range and description; some may change at run time."""

import math
import sys
import weakref
from collections.abc import Callable, Iterable, Mapping
from typing import Any, TypeVar

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.parameter import Parameter

from intent_recognition.errors import ArgumentError, IntentError, one_line

Changes = Mapping[str, Any]
"""New values by parameter name; each has the type it was declared with."""

Value = TypeVar("Value")

_checked: weakref.WeakSet[Node] = weakref.WeakSet()
"""Nodes that already refuse NaN and infinity."""


def parameter(
    node: Node,
    name: str,
    default: Value,
    description: str,
    minimum: float | None = None,
    maximum: float | None = None,
    *,
    read_only: bool = False,
) -> Value:
    """Declare a parameter with type, range and description, and return its value.

    Args:
        node: owner of the parameter.
        name: parameter name.
        default: default value, whose type the parameter keeps. An empty list means a list of
            strings; for an empty list of another type pass `Parameter.Type.DOUBLE_ARRAY` or the
            like.
        description: one sentence for `ros2 param describe`.
        minimum: smallest value allowed (numbers only).
        maximum: largest value allowed (numbers only).
        read_only: True if it cannot change after start.

    Returns:
        The value, with overrides applied. Integers given for floats (`rate:=0`) become floats; an
        array becomes a Python list, and an unset one `[]`.

    Raises:
        ArgumentError: an override has the wrong type, is not finite or lies outside the range.
    """
    descriptor = ParameterDescriptor(description=description, read_only=read_only)
    if minimum is not None or maximum is not None:
        _add_range(descriptor, isinstance(default, float), minimum, maximum)
    if _is_floating(default):
        _convert_integer_override(node, name)
    unset = isinstance(default, (list, tuple)) and not default
    declared_as: Any = Parameter.Type.STRING_ARRAY if unset else default
    try:
        declared = node.declare_parameter(name, declared_as, descriptor)
    except ParameterException as error:
        raise ArgumentError(f"parameter {name}: {one_line(error)}. {description}") from error
    if declared.value is None and isinstance(declared_as, Parameter.Type):
        # Left without a value, it would make `ros2 param dump` of the whole node print `{}`; and
        # rclpy takes an empty list for one of bytes, where the type is not said.
        node._parameters[name] = Parameter(name, declared_as, [])
    if not _is_finite(declared.value):
        raise ArgumentError.about(
            f"parameter {name}", "a finite number", declared.value, description
        )
    if node not in _checked:
        _checked.add(node)
        node.add_on_set_parameters_callback(_refuse_not_finite)
    return plain(declared.value)


def fixed_parameter(
    node: Node,
    name: str,
    default: Value,
    description: str,
    minimum: float | None = None,
    maximum: float | None = None,
) -> Value:
    """Declare a parameter that cannot change after start; see `parameter`."""
    return parameter(node, name, default, description, minimum, maximum, read_only=True)


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
    """Let parameters of a node change.

    rclpy refuses wrong types, values out of range and read-only parameters, and `parameter` what
    is not finite; `check` refuses values that do not fit one another.

    Args:
        node: node that has declared them.
        names: parameters that may change.
        check: raises an IntentError if the new values cannot be taken; changes nothing.
        apply: takes the new values.
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


def _is_floating(default: object) -> bool:
    """Whether a parameter of this default holds floats."""
    if isinstance(default, (list, tuple)):
        return any(isinstance(value, float) for value in default)
    return isinstance(default, float) or default == Parameter.Type.DOUBLE_ARRAY


def _convert_integer_override(node: Node, name: str) -> None:
    """Take `rate:=1` for 1.0 and `home:=[0, 0]` for [0.0, 0.0]; rclpy would refuse both."""
    override = node._parameter_overrides.get(name)
    if override is None:
        return
    kind, value = Parameter.Type, override.value
    if override.type_ == kind.INTEGER:
        node._parameter_overrides[name] = Parameter(name, kind.DOUBLE, float(value))
    elif override.type_ == kind.INTEGER_ARRAY:
        node._parameter_overrides[name] = Parameter(
            name, kind.DOUBLE_ARRAY, list(map(float, value))
        )


def _add_range(
    descriptor: ParameterDescriptor, floating: bool, minimum: float | None, maximum: float | None
) -> None:
    if floating:
        descriptor.floating_point_range = [
            FloatingPointRange(
                from_value=float(-sys.float_info.max if minimum is None else minimum),
                to_value=float(sys.float_info.max if maximum is None else maximum),
                step=0.0,
            )
        ]
    else:
        descriptor.integer_range = [
            IntegerRange(
                from_value=int(-(2**63) if minimum is None else minimum),
                to_value=int(2**63 - 1 if maximum is None else maximum),
                step=1,
            )
        ]


def _is_finite(value: object) -> bool:
    """False for NaN and infinity: a range alone lets NaN through."""
    return not isinstance(value, float) or math.isfinite(value)


def _refuse_not_finite(parameters: list[Parameter]) -> SetParametersResult:
    """Let no parameter become NaN or infinite at run time."""
    for changed in parameters:
        is_array = changed.type_ == Parameter.Type.DOUBLE_ARRAY
        if not all(map(_is_finite, changed.value if is_array else [changed.value])):
            reason = f"parameter {changed.name}: expected finite numbers, got {changed.value}"
            return SetParametersResult(successful=False, reason=reason)
    return SetParametersResult(successful=True)
