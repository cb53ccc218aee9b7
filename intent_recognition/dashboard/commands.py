# SPDX-License-Identifier: Apache-2.0
"""Service calls of the page to other nodes; each answer is reported in one sentence."""

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
"""Services of simulated arms, of which at most one is there."""


class Commands:
    """Service calls that do not block, one at a time of each service.

    Args:
        node: owner of the clients.
        notify: called with (whether it went well, what happened) when an answer has come.

    Attributes:
        notify: the same, for who has something to say.
        helping: whether the activation is active, as it last reported; see `ask_for_help`.
    """

    def __init__(self, node: Node, notify: Notify):
        self._node, self.notify = node, notify
        self._clients: dict[str, Client] = {}
        self._calls: dict[str, tuple[Future, float]] = {}
        self.helping = True
        for service in LEARNING:  # known to the teacher before: answers to new clients can be lost
            self._client(f"{TEACHER}/{service}", Trigger)
        self._feedback = node.create_publisher(DiagnosticStatus, "intent/feedback", qos.FEEDBACK)
        self._answers = node.create_publisher(String, "intent/answer", qos.STATE)

    def offers(self, service: str, kind: type = Trigger) -> bool:
        """Whether a service is available, such as `task_teacher/start`."""
        return self._client(service, kind).service_is_ready()

    def can_switch_help(self) -> bool:
        """Whether there is an activation to switch on and off."""
        return self.offers(f"{ACTIVATION}/change_state", ChangeState) and self.offers(
            f"{ACTIVATION}/get_state", GetState
        )

    def can_guide(self) -> bool:
        """Whether there is an arm that can be guided by hand."""
        return any(self.offers(service, SetBool) for service in GUIDING)

    def trigger(self, service: str, done: Notify | None = None) -> None:
        """Call a Trigger."""
        self._call(service, Trigger, Trigger.Request(), done)

    def tell(self, task: str, values: Mapping[str, str]) -> None:
        """Say something about the execution of a task, now or last."""
        self._feedback.publish(DiagnosticStatus(name=task, values=key_values(values)))

    def answer(self, task: str) -> None:
        """Say which task the movement under way is."""
        self._answers.publish(String(data=task))

    def gravity_compensation(self, enabled: bool) -> None:
        """Let the arm be guided, or hold it."""
        request = SetBool.Request(data=enabled)
        offered = [service for service in GUIDING if self.offers(service, SetBool)]
        self._call((offered or GUIDING)[0], SetBool, request, None)

    def robot_helps(self, enabled: bool, done: Notify | None = None) -> None:
        """Activate or deactivate `primitive_activation`, unless that is what it is already."""
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
        """Ask the activation whether it is active, whoever switched it; `helping` follows."""
        self._ask_for_state(self._on_state)

    def give_up_lost(self) -> None:
        """Await no answer of a service that is gone: who asked is told so."""
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
        """Ask the activation for its state, unless it is being asked; false if there is none."""
        service = f"{ACTIVATION}/get_state"
        if not self._client(service, GetState).service_is_ready():
            return False
        asked = self._awaited(service) or self._send(service, GetState.Request())
        asked.add_done_callback(then)
        return True

    def _awaited(self, service: str) -> Future | None:
        """The call of a service whose answer is awaited."""
        future, since_s = self._calls.get(service, (None, 0.0))
        if future is None or future.done() or time.monotonic() - since_s > ANSWER_S:
            return None
        return future

    def _send(self, service: str, request: object) -> Future:
        """Call a service; one that has not answered is given up."""
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
