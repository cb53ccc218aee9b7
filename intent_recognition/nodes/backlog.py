# SPDX-License-Identifier: Apache-2.0
"""What to do when observations come faster than they can be used: thin them, the newest stays."""

from collections.abc import Callable, Sequence
from typing import Generic, TypeVar

from rclpy.subscription import Subscription

MAX_WAITING = 16
"""More waiting messages than these, twice on end, mean that the node cannot keep up."""

Item = TypeVar("Item")


class Backlog(Generic[Item]):
    """A subscription's callback that looks at all messages that wait, not at one.

    The executor hands over one message at a time, the oldest. Whatever waits behind it is taken at
    once. Where more than `MAX_WAITING` wait although the last ones were only just worked off, the
    queue would grow: evenly spaced ones are used, the newest always. Observations close in time
    share one piece of evidence (`TaskLibrary.noise_covariance`), so little is lost. A queue that
    has grown once, while a model was loaded, say, is worked off whole.

    Args:
        use: takes each message that is used, oldest first.
        dropped: told how many were not.
    """

    def __init__(self, use: Callable[[Item], None], dropped: Callable[[int], None]):
        self._use, self._dropped = use, dropped
        self._subscription: Subscription | None = None
        self._behind = False

    def attach(self, subscription: Subscription) -> Subscription:
        """The subscription whose callback this is."""
        self._subscription = subscription
        return subscription

    def __call__(self, message: Item) -> None:
        """Use a message and whatever waits behind it."""
        waiting = [message, *self._take_waiting()]
        too_many = len(waiting) > MAX_WAITING
        used = thin(waiting, MAX_WAITING) if too_many and self._behind else waiting
        self._behind = too_many
        if len(used) < len(waiting):
            self._dropped(len(waiting) - len(used))
        for one in used:
            self._use(one)

    def _take_waiting(self) -> list[Item]:
        taken: list[Item] = []
        if self._subscription is None:
            return taken
        with self._subscription.handle:
            handle = self._subscription.handle
            while (found := handle.take_message(self._subscription.msg_type, False)) is not None:
                taken.append(found[0])
        return taken


def thin(items: Sequence[Item], most: int) -> list[Item]:
    """At most so many of the items, evenly spaced, the last one always."""
    n = len(items)
    if n <= most:
        return list(items)
    return [items[(k + 1) * n // most - 1] for k in range(most)]
