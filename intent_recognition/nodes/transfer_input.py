# SPDX-License-Identifier: Apache-2.0
"""Whether an object changes hands, from `intent/transfer`: until when the arm must not leave."""

from collections import deque

from sensor_msgs.msg import JointState

from intent_recognition.nodes import qos
from intent_recognition.nodes.conversions import stamp_ns
from intent_recognition.nodes.diagnostics import Diagnostics
from intent_recognition.transfer import EXCHANGES

TRANSFER = "intent/transfer"
FRESH_NS = 300_000_000
"""A state counts for so long [ns]. Convention: as `object_transfer` takes a sensor's."""
_STATES = {state.value for state in EXCHANGES}


class TransferInput:
    """Keeps the newest states; one counts for what is later than its stamp.

    Where time waits for the nodes, whichever message of one time comes first changes nothing so.
    """

    def __init__(self, diagnostics: Diagnostics) -> None:
        self._states: deque[tuple[int, bool]] = deque(maxlen=2)
        diagnostics.subscribe(JointState, TRANSFER, self._take, qos.STATE)

    def _take(self, message: JointState) -> None:
        self._states.append((stamp_ns(message), message.header.frame_id in _STATES))

    def exchanging_until_ns(self, now_ns: int) -> int:
        """Until when an object changes hands, as far as is known now; 0: it does not."""
        for at_ns, exchanges in reversed(self._states):
            if at_ns < now_ns:
                return at_ns + FRESH_NS if exchanges else 0
        return 0
