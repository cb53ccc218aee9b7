# SPDX-License-Identifier: Apache-2.0
"""Services that run one action, and answer with its result."""

from collections.abc import Callable
from typing import TypeVar

from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger

from intent_recognition.errors import IntentError

Response = TypeVar("Response", Trigger.Response, SetBool.Response)


def serve(node: Node, name: str, action: Callable[[], str]) -> None:
    """Offer the Trigger service `~/<name>`; see `answer`."""
    node.create_service(Trigger, f"~/{name}", lambda _, response: answer(response, action))


def answer(response: Response, action: Callable[[], str]) -> Response:
    """Fill a service's response with what `action` returns, or with why it failed."""
    try:
        response.message = action()
        response.success = True
    except (IntentError, OSError) as error:
        response.success = False
        response.message = str(error)
    return response
