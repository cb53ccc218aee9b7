# SPDX-License-Identifier: Apache-2.0
"""Streams that never pause while all is well: which have fallen silent, in real time."""

import time
from collections.abc import Mapping

SILENT_S = 0.6
"""A stream without a message for this long is reported as silent [s]. Convention: with the time
between two looks, a sender that died is named within 1 s."""


class SilenceWatch:
    """Knows when each stream was heard last.

    Args:
        senders: who is dead if a stream pauses, by topic.
    """

    def __init__(self, senders: Mapping[str, str]) -> None:
        self._senders = senders
        self._heard_s = dict.fromkeys(senders, time.monotonic())

    def hear(self, topic: str) -> None:
        """A message came."""
        self._heard_s[topic] = time.monotonic()

    def silent(self) -> str:
        """Which streams are silent, with their senders; empty if none is."""
        latest_s = time.monotonic() - SILENT_S
        dead = [name for name, heard_s in self._heard_s.items() if heard_s < latest_s]
        return f"silent: {', '.join(f'{d} ({self._senders[d]})' for d in dead)}" if dead else ""
