# SPDX-License-Identifier: Apache-2.0
"""Service calls from the page to other nodes; each answer is reported in one sentence."""

import time
from collections.abc import Callable, Mapping
from functools import partial

from diagnostic_msgs.msg import DiagnosticStatus
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.srv import SetParameters
from rclpy.client import Client
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.task import Future
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger

from intent_recognition.nodes import qos
from intent_recognition.nodes.diagnostics import key_values
from intent_recognition.nodes.graph import ARMS
from intent_recognition.nodes.runtime import ANSWER_S
from intent_recognition.registry import LEARNING

Notify = Callable[[bool, str], None]
ESTIMATOR, ACTIVATION, TEACHER = ("intent_estimator", "primitive_activation", "task_teacher")
GUIDING = tuple(f"{arm}/gravity_compensation" for arm in ARMS)
"""Services that let a simulated arm be guided by hand; at most one of them exists."""


class Commands:
    """Non-blocking service calls, at most one at a time per service.

    Args:
        node: owner of the clients.
        notify: called with (success, sentence) when an answer arrives.

    Attributes:
        notify: the argument of the same name, for other parts of the page.
        helping: whether the activation node was active when last asked; see `ask_for_help`.
    """

    def __init__(self, node: Node, notify: Notify):
        self._node, self.notify = node, notify
        self._clients: dict[str, Client] = {}
        self._calls: dict[str, tuple[Future, float]] = {}
        self.helping = True
        for service in LEARNING:  # created early: answers to a new client can be lost
            self._client(f"{TEACHER}/{service}", Trigger)
        self._feedback = node.create_publisher(DiagnosticStatus, "intent/feedback", qos.FEEDBACK)
        self._answers = node.create_publisher(String, "intent/answer", qos.STATE)

    def offers(self, service: str, kind: type = Trigger) -> bool:
        """Whether a service is available, such as `task_teacher/start`."""
        return self._client(service, kind).service_is_ready()

    def can_switch_help(self) -> bool:
        """Whether there is an activation node to switch on or off."""
        return self.offers(f"{ACTIVATION}/change_state", ChangeState) and self.offers(
            f"{ACTIVATION}/get_state", GetState
        )

    def can_guide(self) -> bool:
        """Whether there is an arm that can be guided by hand."""
        return any(self.offers(service, SetBool) for service in GUIDING)

    def trigger(self, service: str, done: Notify | None = None) -> None:
        """Call a Trigger service."""
        self._call(service, Trigger, Trigger.Request(), done)

    def tell(self, task: str, values: Mapping[str, str]) -> None:
        """Send feedback on the present or last execution of a task."""
        self._feedback.publish(DiagnosticStatus(name=task, values=key_values(values)))

    def answer(self, task: str) -> None:
        """Answer which task the present movement is."""
        self._answers.publish(String(data=task))

    def gravity_compensation(self, enabled: bool) -> None:
        """Let the arm be guided by hand, or make it hold its position."""
        request = SetBool.Request(data=enabled)
        offered = [service for service in GUIDING if self.offers(service, SetBool)]
        self._call((offered or GUIDING)[0], SetBool, request, None)

    def robot_helps(self, enabled: bool, done: Notify | None = None) -> None:
        """Activate or deactivate `primitive_activation`, unless it is already in that state."""
        wanted = Transition.TRANSITION_ACTIVATE if enabled else Transition.TRANSITION_DEACTIVATE
        request = ChangeState.Request(transition=Transition(id=wanted))
        notify = done or self.notify

        def switched(ok: bool, text: str) -> None:
            self.helping = enabled if ok else self.helping
            notify(ok, text)

        def switch(future: Future) -> None:
            self._on_state(future)
            if future.cancelled():
                notify(False, f"{ACTIVATION}/get_state did not answer")
            elif self.helping == enabled:
                notify(True, "")
            else:
                self._call(f"{ACTIVATION}/change_state", ChangeState, request, switched)

        if not self._ask_for_state(switch):
            notify(False, f"no node offers {ACTIVATION}/get_state")

    def ask_for_help(self) -> None:
        """Ask whether the activation is active, whoever switched it; `helping` is updated."""
        self._ask_for_state(self._on_state)

    def give_up_lost(self) -> None:
        """Stop waiting for services that are gone, and report this to the callers."""
        for service, (future, _) in list(self._calls.items()):
            if not future.done() and not self._clients[service].service_is_ready():
                future.cancel()

    def set_parameter(
        self, node: str, name: str, value: object, done: Notify | None = None
    ) -> None:
        """Set a parameter of another node."""
        request = SetParameters.Request(
            parameters=[Parameter(name, value=value).to_parameter_msg()]
        )
        self._call(f"{node}/set_parameters", SetParameters, request, done)

    def _client(self, service: str, kind: type) -> Client:
        if service not in self._clients:
            self._clients[service] = self._node.create_client(kind, service)
        return self._clients[service]

    def _call(self, service: str, kind: type, request: object, done: Notify | None) -> None:
        client = self._client(service, kind)
        notify = done or self.notify
        if not client.service_is_ready():
            notify(False, f"no node offers {service}")
        elif self._awaited(service) is not None:
            notify(False, f"{service} has not answered the last call yet")
        else:
            self._send(service, request).add_done_callback(partial(self._answered, service, notify))

    def _ask_for_state(self, then: Callable[[Future], None]) -> bool:
        """Request the activation's state unless a request is pending; False without a service."""
        service = f"{ACTIVATION}/get_state"
        if not self._client(service, GetState).service_is_ready():
            return False
        asked = self._awaited(service) or self._send(service, GetState.Request())
        asked.add_done_callback(then)
        return True

    def _awaited(self, service: str) -> Future | None:
        """The pending call of a service, None if there is none."""
        future, since_s = self._calls.get(service, (None, 0.0))
        if future is None or future.done() or time.monotonic() - since_s > ANSWER_S:
            return None
        return future

    def _send(self, service: str, request: object) -> Future:
        """Call a service; a pending call of the same service is abandoned."""
        before = self._calls.get(service)
        future = self._clients[service].call_async(request)
        self._calls[service] = future, time.monotonic()
        if before is not None:
            before[0].cancel()
        return future

    def _on_state(self, future: Future) -> None:
        if not future.cancelled():
            self.helping = future.result().current_state.label == "active"

    def _answered(self, service: str, notify: Notify, future: Future) -> None:
        if future.cancelled():
            notify(False, f"{service} did not answer")
            return
        answer = future.result()
        if isinstance(answer, SetParameters.Response):
            results = answer.results
            notify(all(r.successful for r in results), "; ".join(r.reason for r in results))
            return
        message = getattr(answer, "message", "") or service
        notify(bool(answer.success), message)
