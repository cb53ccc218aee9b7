# SPDX-License-Identifier: Apache-2.0
"""Starting, spinning and ending a node."""

import faulthandler
import gc
import os
import re
import signal
import sys
import time
import traceback
from collections.abc import Callable, Hashable, Iterator, Sequence
from contextlib import contextmanager
from typing import TypeVar

import rclpy
from rclpy.clock import Clock, ClockType, JumpThreshold, ROSClock, TimeJump
from rclpy.duration import Duration
from rclpy.exceptions import NameValidationException, NotInitializedException, ParameterException
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.timer import Timer
from rclpy.utilities import try_shutdown

from intent_recognition.errors import ArgumentError, IntentError, one_line
from intent_recognition.interrupts import SAME_S
from intent_recognition.nodes.parameters import check_given

SomeNode = TypeVar("SomeNode", bound=Node)
_START_ERRORS = (
    IntentError,
    ParameterException,
    NameValidationException,
    rclpy_implementation.RCLError,
)
ANSWER_S = 5.0
"""Time after which an unanswered request is repeated [s]; a model is loaded in less than 1 s."""
CLOCK_BACK_NS = 100_000_000
"""Jump back of /clock above which time starts over [ns]: above jitter, below any recording."""
END_S = 30.0
"""Time to destroy a node, after which its process ends [s]: longer than closing any file takes."""


def run(make_node: Callable[[], Node], args: Sequence[str] | None = None) -> int:
    """Run one node until it is done, is interrupted or is asked to terminate.

    The node ends its process by setting an attribute `done` to True, by `rclpy.try_shutdown()`,
    or by raising an IntentError; an attribute `exit_code` on the node, if any, is returned.
    SIGINT and SIGTERM end it with 0, once it is built and the running callback is done: an
    interrupt raised inside a callback would leave a traceback and lose what it was writing. A
    terminal and launch both send a signal, so a second one within `SAME_S` counts as the same;
    a later one interrupts at once.

    `args` is a command line with `--ros-args ...`; None takes that of the process. A parameter
    that the node does not have is an error here, though rclpy ignores it.

    Returns:
        The exit code: 1 with one line in the log, and no traceback, if the node could not start
        or gave up with an IntentError.
    """
    os.environ.setdefault("AMENT_PREFIX_PATH", sys.prefix)
    node = None
    signals = _Signals()
    try:
        _init(args)
        node = make_node()
        check_given(node, sys.argv if args is None else args)
        settle()
        node.get_logger().info("ready")
        _spin(node, signals)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except _START_ERRORS as error:
        if node is None:  # free the half-built node, which occupies its name
            held: BaseException | None = error
            while held is not None:
                traceback.clear_frames(held.__traceback__)
                held = held.__cause__ or held.__context__
            gc.collect()
        _log_fatal(node, getattr(make_node, "__name__", "node"), one_line(error))
        return 1
    finally:
        signals.ignore()
        try:
            end(node)
            try_shutdown()
        finally:
            signals.restore(ending=args is None)
    return int(getattr(node, "exit_code", 0) or 0)


def settle() -> None:
    """Collect garbage once, then exempt all present objects from later collections.

    Modules, message types and a model are some hundred thousand objects that stay; traversing
    them in each collection delays an answer by ten milliseconds and more.
    """
    gc.collect()
    gc.freeze()


def now_ns(node: Node) -> int:
    """Time of the node's clock [ns]."""
    return int(node.get_clock().now().nanoseconds)


def elapsed_s(node: Node) -> float:
    """Seconds since an arbitrary start, for timeouts of a node.

    Simulated time with `use_sim_time`, so that nothing times out while simulated time stands
    still; else a monotonic clock.
    """
    simulated = simulated_ns(node)
    return time.monotonic() if simulated is None else simulated * 1e-9


def simulated_ns(node: Node) -> int | None:
    """Time on /clock [ns], 0 before its first message; None without `use_sim_time`."""
    clock = node.get_clock()
    active = isinstance(clock, ROSClock) and clock.ros_time_is_active
    return clock.now().nanoseconds if active else None


def steady_timer(node: Node, period_s: float, callback: Callable[[], object]) -> Timer:
    """A timer in real time, which also runs while simulated time stands still."""
    clock = Clock(clock_type=ClockType.STEADY_TIME)
    return node.create_timer(period_s, callback, clock=clock)


def when_clock_goes_back(node: Node, action: Callable[[], object]) -> None:
    """Call `action` when simulated time goes back: a recording repeats, a simulation restarts."""

    def jumped(jump: TimeJump) -> None:
        node.get_logger().info(f"/clock went back by {-jump.delta.nanoseconds * 1e-9:.1f} s")
        action()

    least = Duration(nanoseconds=-CLOCK_BACK_NS)
    threshold = JumpThreshold(min_forward=None, min_backward=least, on_clock_change=False)
    handle = node.get_clock().create_jump_callback(threshold, post_callback=jumped)
    node.__dict__.setdefault("_jump_handles", []).append(handle)  # it ends with the last reference


class LeftOvers:
    """Detects messages sent before /clock went back, which may come for a second afterwards.

    Attributes:
        last_ns: newest stamp of each stream since then, which its user sets.
    """

    def __init__(self) -> None:
        self.last_ns: dict[Hashable, int] = {}
        self._before: dict[Hashable, int] = {}
        self._end_s = 0.0

    def start_over(self) -> None:
        """Accept earlier stamps from now on: the clock went back."""
        self._before, self.last_ns = self.last_ns, {}
        self._end_s = time.monotonic() + 1.0

    def include(self, stream: Hashable, stamp_ns: int) -> bool:
        """Whether a message continues its old stream; False from the first that does not."""
        if stamp_ns >= self._before.get(stream, 2**63) and time.monotonic() < self._end_s:
            return True
        self._before.pop(stream, None)
        return False


def make_executor() -> Executor:
    """EventsExecutor if this rclpy has one (lowest latency), else the single-threaded one.

    Call `spin_once(timeout_sec=...)` on it in a loop: in the wheels of rclpy 7.1 its `spin()`
    burns a core and dispatches nothing.
    """
    try:
        from rclpy.experimental import EventsExecutor
    except ImportError:
        return SingleThreadedExecutor()
    return EventsExecutor()


def spin_until(executor: Executor, condition: Callable[[], object], timeout_s: float) -> bool:
    """Run callbacks until a condition holds, at most `timeout_s` [s]; returns whether it holds."""
    end_s = time.monotonic() + timeout_s
    while not condition():
        if time.monotonic() > end_s:
            return False
        executor.spin_once(timeout_sec=0.05)
    return True


@contextmanager
def spinning(
    make_node: Callable[[], SomeNode], args: Sequence[str] = ()
) -> Iterator[tuple[SomeNode, Executor]]:
    """A node of this process and the executor that runs its callbacks; both end with the block.

    The node is built after `rclpy.init`, which installs no signal handlers.
    """
    _init(args)
    executor = node = None
    try:
        executor = make_executor()
        node = make_node()
        executor.add_node(node)
        yield node, executor
    finally:
        end(node, executor)
        try_shutdown()


def end(node: Node | None, executor: Executor | None = None) -> None:
    """Shut an executor down and destroy a node, if they were made.

    If that takes longer than `END_S`, the process ends with exit code 1 and a traceback on stderr.
    Otherwise the Fast DDS of the ROS wheels may spin for ever when the last node of a process is
    destroyed while another one is being discovered (docs/decisions/ros.md).
    """
    faulthandler.dump_traceback_later(END_S, exit=True, file=2)  # needs no thread of Python
    try:
        if executor is not None:
            executor.shutdown()
        if node is not None:
            node.destroy_node()
    finally:
        faulthandler.cancel_dump_traceback_later()


def _init(args: Sequence[str] | None) -> None:
    domain, words = os.environ.get("ROS_DOMAIN_ID", ""), None if args is None else list(args)
    # the ports of larger domains do not fit into 16 bits (DDSI-RTPS 2.5, 9.6.2.3)
    if domain and not (domain.isdecimal() and int(domain) <= 232):
        raise ArgumentError.about("ROS_DOMAIN_ID", "0 to 232", repr(domain), "Use 0 to 101.")
    try:
        rclpy.init(args=words, signal_handler_options=SignalHandlerOptions.NO)
    except rclpy_implementation.UnknownROSArgsError as error:
        expected = "-p, -r, --params-file and the like"
        raise ArgumentError.about("--ros-args", expected, error, "See --help.") from error


class _Signals:
    """Notes SIGINT and SIGTERM; one more than `SAME_S` after the first is a KeyboardInterrupt."""

    def __init__(self) -> None:
        self.received = False
        self._first_s = 0.0
        numbers = (signal.SIGINT, signal.SIGTERM)
        self._previous = {number: signal.signal(number, self._handle) for number in numbers}

    def ignore(self) -> None:
        """Ignore signals: a second Ctrl-C while the node ends must not leave a traceback."""
        for number in self._previous:
            signal.signal(number, signal.SIG_IGN)

    def restore(self, *, ending: bool) -> None:
        """Restore the previous handlers; a process that is ending still ignores SIGINT."""
        for number, handler in self._previous.items():
            ignored = ending and number == signal.SIGINT
            signal.signal(number, signal.SIG_IGN if ignored else handler)

    def _handle(self, *_: object) -> None:
        now_s = time.monotonic()
        if not self.received:
            self.received, self._first_s = True, now_s
        elif now_s - self._first_s > SAME_S:
            raise KeyboardInterrupt


def _spin(node: Node, signals: _Signals) -> None:
    executor = make_executor()
    executor.add_node(node)
    diagnostics = getattr(node, "diagnostics", None) or getattr(node, "_diagnostics", None)
    try:
        while rclpy.ok() and not signals.received and not getattr(node, "done", False):
            executor.spin_once(timeout_sec=0.1)
            if diagnostics is not None:
                diagnostics.answer()
    finally:
        executor.shutdown()


def _log_fatal(node: Node | None, class_name: str, text: str) -> None:
    """Log why a node ends, under its name; on stderr if no node can be made."""
    try:
        if node is None:  # the same remapping gives a node in its place the name it would have had
            name = re.sub(r"(?<!^)(?=[A-Z])", "_", class_name.removesuffix("Node")).lower()
            node = rclpy.create_node(name, start_parameter_services=False, enable_rosout=False)
            node.get_logger().fatal(text)
            end(node)
        else:
            node.get_logger().fatal(text)
    except (*_START_ERRORS, NotInitializedException):
        sys.stderr.write(f"{class_name}: {text}\n")
