# SPDX-License-Identifier: Apache-2.0
"""A lifecycle node that starts active and reports every exception."""

import sys
import traceback
from collections.abc import Callable
from functools import partial
from typing import Any

from lifecycle_msgs.srv import ChangeState
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn

from intent_recognition.errors import ArgumentError, IntentError
from intent_recognition.nodes.parameters import check_given, declare


class ManagedNode(LifecycleNode):
    """Base of the nodes that can be configured, activated and deactivated at run time.

    A subclass overrides `configure`, `activate` and `deactivate` (plain methods that raise on
    failure) and calls `self.start()` as the last line of its constructor. With the
    parameter `autostart` (default true) the node is then active, and an IntentError raised on
    the way reaches the caller; otherwise it waits for `~/change_state`.

    rclpy swallows exceptions of lifecycle callbacks. Here an IntentError is logged in one line and
    the transition fails, so that the node keeps its state. Any other exception is logged with its
    traceback, and the transition goes through error processing to unconfigured.
    """

    def __init__(self, name: str, **kwargs: Any) -> None:
        super().__init__(name, **kwargs)
        self._failure: Exception | None = None
        self._starting = False
        change = self._service_change_state
        change.callback = partial(self._refuse_impossible, change.callback)
        self._autostart = declare(self, "lifecycle")["autostart"]

    def configure(self) -> None:
        """Load what is needed; called on the way from unconfigured to inactive."""

    def activate(self) -> None:
        """Begin to act; called on the way from inactive to active."""

    def deactivate(self) -> None:
        """Stop acting, safely; called on the way from active to inactive or finalized.

        It is also called after `activate` has failed at any point.
        """

    @property
    def active(self) -> bool:
        """Whether the node is in the state `active`."""
        return self._state_machine.current_state[1] == "active"

    def check_active(self) -> None:
        """Raise an ArgumentError if the node is not active."""
        if not self.active:
            raise ArgumentError("the node is not active")

    def start(self) -> None:
        """Configure and activate if `autostart` is set, unless a parameter is misspelt.

        Raises:
            ArgumentError: the process was given a parameter that the node does not have.
        """
        check_given(self, sys.argv)
        if not self._autostart:
            return
        self._starting = True
        for trigger in (self.trigger_configure, self.trigger_activate):
            if trigger() != TransitionCallbackReturn.SUCCESS:
                raise self._failure or RuntimeError("a lifecycle transition failed")
        self._starting = False

    def destroy_node(self) -> None:
        """Close the node; it leaves the graph at once.

        rclpy 7.1 would keep it there until the garbage collector finds the state machine.
        """
        super().destroy_node()
        del self._state_machine

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Handle the transition to inactive."""
        return self._guard(self.configure, super().on_configure, state, "inactive")

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Handle the transition to active; if it fails, `deactivate` ends what had begun."""

        def activate() -> None:
            try:
                self.activate()
            except Exception:
                self.deactivate()
                raise

        return self._guard(activate, super().on_activate, state, "active")

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Handle the transition back to inactive."""
        return self._guard(self.deactivate, super().on_deactivate, state, "inactive")

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Handle the transition to finalized; an active node is deactivated first."""
        end = self.deactivate if state.label == "active" else lambda: None
        return self._guard(end, super().on_shutdown, state, "finalized")

    def _refuse_impossible(
        self, change: Callable, request: ChangeState.Request, response: ChangeState.Response
    ) -> ChangeState.Response:
        """Refuse a transition that is impossible in this state; rclpy 7.1 would end the node."""
        possible = {number for number, *_ in self._state_machine.available_transitions}
        if request.transition.label or request.transition.id in possible:
            return change(request, response)
        state = self._state_machine.current_state[1]
        self.get_logger().warning(f"no transition {request.transition.id} from state {state}")
        response.success = False
        return response

    def _guard(
        self,
        hook: Callable[[], None],
        default: Callable[[LifecycleState], TransitionCallbackReturn],
        state: LifecycleState,
        becomes: str,
    ) -> TransitionCallbackReturn:
        self._failure = None
        try:
            hook()
        except IntentError as error:
            self._failure = error
            if not self._starting:  # else `start` raises it, and it is reported once
                self.get_logger().error(f"{hook.__name__}: {error}")
            return TransitionCallbackReturn.FAILURE
        except Exception as error:
            self._failure = error
            self.get_logger().error(f"{hook.__name__} failed:\n{traceback.format_exc()}")
            return TransitionCallbackReturn.ERROR
        result = default(state)
        if result == TransitionCallbackReturn.SUCCESS:
            self.get_logger().info(f"{becomes}, was {state.label}")
        return result
