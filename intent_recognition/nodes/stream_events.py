# SPDX-License-Identifier: Apache-2.0
"""What the middleware tells of a stream's publishers: how many there are, and who cannot be heard.

Deadlines and liveliness leases are not asked for: a publisher that offers none, as trackers, arms
and bag players do, does not match a subscription that asks, and would never be heard; and they
run on the computer's clock, so that simulated time would break them whenever it stands still.
Silence is seen by the nodes' own watchdogs.
"""

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import qos_policy_name_from_kind

from intent_recognition.nodes.diagnostics import Diagnostics


def watch(diagnostics: Diagnostics, topic: str) -> SubscriptionEventCallbacks:
    """Events of a subscription that report to the diagnostics.

    `publishers <topic>` says how many there are, from the first one on; one whose quality of
    service does not fit is counted under `incompatible_qos`.
    """

    def matched(info) -> None:
        diagnostics.value(f"publishers {topic}", info.current_count)

    def incompatible(info) -> None:
        policy = qos_policy_name_from_kind(info.last_policy_kind)
        diagnostics.reject("incompatible_qos", f"a publisher of {topic} offers less {policy}")

    return SubscriptionEventCallbacks(matched=matched, incompatible_qos=incompatible)
