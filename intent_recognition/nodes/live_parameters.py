# SPDX-License-Identifier: Apache-2.0
"""Parameters that can change while the node runs: checked first, refused with the reason."""

from collections.abc import Callable, Iterable, Mapping

from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from intent_recognition.errors import IntentError

Changes = Mapping[str, object]


def keep_live(
    node: Node,
    names: Iterable[str],
    check: Callable[[Changes], object],
    apply: Callable[[Changes], object],
) -> None:
    """Let parameters of a node change.

    Types, ranges and read-only ones are rclpy's own to refuse, and numbers that are none those of
    `runtime.parameter`; what several values mean together is the node's.

    Args:
        node: has declared them.
        names: of those that may change.
        check: raises an IntentError where the new values cannot be taken; changes nothing.
        apply: takes the new values.
    """
    known = frozenset(names)

    def select(parameters: list[Parameter]) -> dict[str, object]:
        return {p.name: plain(p.value) for p in parameters if p.name in known}

    def on_set(parameters: list[Parameter]) -> SetParametersResult:
        changes = select(parameters)
        try:
            if changes:
                check(changes)
        except IntentError as error:
            return SetParametersResult(successful=False, reason=" ".join(str(error).split()))
        return SetParametersResult(successful=True)

    def after_set(parameters: list[Parameter]) -> None:
        changes = select(parameters)
        if changes:
            apply(changes)
            shown = ", ".join(f"{name} {value}" for name, value in changes.items())
            node.get_logger().info(f"changed: {shown}")

    node.add_on_set_parameters_callback(on_set)
    node.add_post_set_parameters_callback(after_set)


def plain(value: object) -> object:
    """A parameter's value; arrays as lists, and `[]` for none."""
    if value is None:
        return []
    return value if isinstance(value, (str, bool, int, float)) else list(value)
