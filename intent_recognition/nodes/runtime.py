# SPDX-License-Identifier: Apache-2.0
"""Starting, spinning and ending a node, and declaring its parameters."""

import gc
import math
import os
import signal
import sys
import time
from collections.abc import Callable, Sequence

import rclpy
from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.exceptions import NameValidationException, ParameterException
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import try_shutdown

from intent_recognition.errors import ArgumentError, IntentError, describe
from intent_recognition.nodes.diagnostics import Diagnostics

__all__ = ["Diagnostics", "elapsed_s", "make_executor", "parameter", "run", "settle"]

SPIN_PERIOD_S = 0.1
MAX_DOMAIN = 232
_START_ERRORS = (
    IntentError,
    ParameterException,
    NameValidationException,
    rclpy_implementation.RCLError,
)


def run(make_node: Callable[[], Node], args: Sequence[str] | None = None) -> int:
    """Run one node until it is done, is interrupted or is asked to terminate.

    The node ends its process by setting an attribute `done` to True, by `rclpy.try_shutdown()`,
    or by raising an IntentError; an attribute `exit_code` on the node, if any, is returned.
    SIGINT and SIGTERM end it with 0, once the callback in hand is done: an interrupt raised
    inside a callback would leave a traceback and lose what it was writing. A second signal
    interrupts at once.

    Args:
        make_node: builds the node; called once, after `rclpy.init`.
        args: command line with `--ros-args ...`; None takes the process's own.

    Returns:
        The exit code: 1 with one line on stderr, and no traceback, if the node could not start
        or gave up with an IntentError.
    """
    os.environ.setdefault("AMENT_PREFIX_PATH", sys.prefix)
    node = None
    signals = _Signals()
    try:
        _check_domain(os.environ.get("ROS_DOMAIN_ID", ""))
        rclpy.init(
            args=None if args is None else list(args),
            signal_handler_options=SignalHandlerOptions.NO,
        )
        node = make_node()
        settle()
        _spin(node, signals)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except _START_ERRORS as error:
        name = getattr(make_node, "__name__", "node") if node is None else node.get_name()
        sys.stderr.write(f"{name}: {_one_line(error)}\n")
        return 1
    finally:
        _close(node)
        signals.restore()
    return int(getattr(node, "exit_code", 0) or 0)


def settle() -> None:
    """Collect garbage once, and let the collector pass over what is there from now on.

    Modules, message types and a model are some hundred thousand objects that stay; to look
    through them again and again delays an answer by ten milliseconds and more.
    """
    gc.collect()
    gc.freeze()


def elapsed_s(node: Node) -> float:
    """Seconds from some beginning on, as they pass for the node.

    Simulated with `use_sim_time`, so that nothing times out while simulated time stands still;
    else of a clock that nobody sets.
    """
    clock = node.get_clock()
    return clock.now().nanoseconds * 1e-9 if clock.ros_time_is_active else time.monotonic()


def make_executor() -> Executor:
    """EventsExecutor where this rclpy has one (lowest latency), else the single-threaded one.

    Call `spin_once(timeout_sec=...)` on it in a loop: in the wheels of rclpy 7.1 its `spin()`
    burns a core and dispatches nothing.
    """
    try:
        from rclpy.experimental import EventsExecutor
    except ImportError:
        return SingleThreadedExecutor()
    return EventsExecutor()


def parameter(
    node: Node,
    name: str,
    default: object,
    description: str,
    *,
    minimum: float | None = None,
    maximum: float | None = None,
    read_only: bool = False,
) -> object:
    """Declare a parameter with type, range and description, and return its value.

    Args:
        node: the node that owns it.
        name: parameter name.
        default: its default, whose type it keeps. An empty list means a list of strings; for
            an empty list of another type pass `Parameter.Type.DOUBLE_ARRAY` or the like.
        description: one sentence for `ros2 param describe`.
        minimum: smallest value allowed (numbers only).
        maximum: largest value allowed (numbers only).
        read_only: True if it cannot change after start.

    Returns:
        The value, with overrides applied. Integers given for floats (`rate:=0`) are taken as
        floats; a list is a Python list, and `[]` if unset.

    Raises:
        ArgumentError: an override has the wrong type or lies outside the range.
    """
    descriptor = ParameterDescriptor(description=description, read_only=read_only)
    if minimum is not None or maximum is not None:
        _add_range(descriptor, default, minimum, maximum)
    if isinstance(default, (list, tuple)) and not default:
        default = Parameter.Type.STRING_ARRAY
    if isinstance(default, float) or default == Parameter.Type.DOUBLE_ARRAY or _floats(default):
        _accept_integer_override(node, name)
    try:
        declared = node.declare_parameter(name, default, descriptor)
    except ParameterException as error:
        raise ArgumentError(f"parameter {name}: {_one_line(error)}. {description}") from error
    if isinstance(declared.value, float) and not math.isfinite(declared.value):
        raise ArgumentError(
            describe(f"parameter {name}", "a finite number", declared.value, description)
        )
    _refuse_what_is_no_number(node)
    if declared.type_ == Parameter.Type.NOT_SET:
        return []
    value = declared.value
    return value if isinstance(value, (str, bool, int, float)) else list(value)


def _refuse_what_is_no_number(node: Node) -> None:
    """Let no parameter become NaN or infinite at run time: a range alone lets NaN through."""
    if getattr(node, "_refuses_what_is_no_number", False):
        return
    node._refuses_what_is_no_number = True
    node.add_on_set_parameters_callback(_check_numbers)


def _check_numbers(parameters: list[Parameter]) -> SetParametersResult:
    for changed in parameters:
        values = changed.value if changed.type_ == Parameter.Type.DOUBLE_ARRAY else [changed.value]
        if any(isinstance(value, float) and not math.isfinite(value) for value in values):
            reason = f"parameter {changed.name}: expected finite numbers, got {changed.value}"
            return SetParametersResult(successful=False, reason=reason)
    return SetParametersResult(successful=True)


def _add_range(descriptor, default, minimum, maximum) -> None:
    if isinstance(default, float):
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


def _check_domain(domain: str) -> None:
    """Refuse what Fast DDS would end the process for."""
    if domain and not (domain.isdecimal() and int(domain) <= MAX_DOMAIN):
        raise ArgumentError(
            describe("ROS_DOMAIN_ID", f"0 to {MAX_DOMAIN}", repr(domain), "Use 0 to 101.")
        )


def _floats(default: object) -> bool:
    return isinstance(default, (list, tuple)) and any(isinstance(v, float) for v in default)


def _accept_integer_override(node: Node, name: str) -> None:
    """Take `rate:=1` for 1.0 and `home:=[0, 0]` for [0.0, 0.0]."""
    override = node._parameter_overrides.get(name)
    if override is None:
        return
    value: object
    if override.type_ == Parameter.Type.INTEGER:
        kind, value = Parameter.Type.DOUBLE, float(override.value)
    elif override.type_ == Parameter.Type.INTEGER_ARRAY:
        kind, value = Parameter.Type.DOUBLE_ARRAY, [float(v) for v in override.value]
    else:
        return
    node._parameter_overrides[name] = Parameter(name, kind, value)


class _Signals:
    """SIGINT and SIGTERM: while spinning the first is only noted, else KeyboardInterrupt."""

    def __init__(self) -> None:
        self.spinning = self.received = False
        numbers = (signal.SIGINT, signal.SIGTERM)
        self._previous = {number: signal.signal(number, self._handle) for number in numbers}

    def restore(self) -> None:
        """Give the signals back to the handlers they had."""
        for number, handler in self._previous.items():
            signal.signal(number, handler)

    def _handle(self, *_: object) -> None:
        first, self.received = not self.received, True
        if not (self.spinning and first):
            raise KeyboardInterrupt


def _spin(node: Node, signals: _Signals) -> None:
    signals.spinning = True
    executor = make_executor()
    executor.add_node(node)
    try:
        while rclpy.ok() and not signals.received and not getattr(node, "done", False):
            executor.spin_once(timeout_sec=SPIN_PERIOD_S)
    finally:
        executor.shutdown()


def _close(node: Node | None) -> None:
    """Destroy and shut down; a second Ctrl-C meanwhile must not leave a traceback."""
    numbers = (signal.SIGINT, signal.SIGTERM)
    previous = {number: signal.signal(number, signal.SIG_IGN) for number in numbers}
    try:
        if node is not None:
            node.destroy_node()
        try_shutdown()
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__
