# SPDX-License-Identifier: Apache-2.0
"""Things in the way of motions: when to search for a way around, and when a motion is refused."""

from intent_recognition.activation.arm_tracking import ArmTracking
from intent_recognition.activation.settings import Common
from intent_recognition.motion import ClearPath, JointPath, Obstruction

SEARCH_EVERY_NS = 250_000_000
"""Time between two searches for detours, and between two attempts to begin, or to go on after a
brake, while no way is clear [ns]. A search takes less than half of it."""


class Things:
    """Keeps the obstruction, and the number of searches, since an interaction last began."""

    def __init__(self, common: Common, arm: ArmTracking) -> None:
        self._arm, self._common = arm, common
        self._reject, self._counts = common.reject, common.counts
        self._n_searches, self._search_ns = 0, 0
        self.obstruction: Obstruction | None = None

    def clear(
        self, now_ns: int, path: JointPath, label: str, phase: float, before: ClearPath | None
    ) -> ClearPath | Obstruction:
        """A path that is clear from a phase on; what is in the way if none is found.

        Only an arm at rest has time for a search, once in `SEARCH_EVERY_NS`: see `Clearance.clear`.
        """
        settings = self._common.settings
        if settings.clearance is None:
            return ClearPath(path)
        rests = not self._arm.under_way(now_ns)
        due = not 0 <= now_ns - self._search_ns < SEARCH_EVERY_NS
        tries = self._n_searches if rests and due else None
        found = settings.clearance.clear(path, label, phase, settings.limits, before, tries)
        if isinstance(found, Obstruction) and tries is not None:
            self._n_searches, self._search_ns = tries + 1, now_ns
        return found

    def begun(self) -> None:
        """Note that an interaction has begun: nothing is in its way."""
        self._n_searches, self.obstruction = 0, None

    def block(self, what: str, obstruction: Obstruction) -> None:
        """Note what is in the way of a motion, which may be tried again."""
        self.obstruction = obstruction
        self._reject("would_touch", f"no motion for {what}: {obstruction}")

    def refuse(self, what: str, obstruction: Obstruction | None = None) -> None:
        """Count and report that a motion is given up because no way is clear."""
        if obstruction is not None:
            self.block(what, obstruction)
        self._counts["refused"] += 1
        self._reject("refused", f"no motion for {what}: {self.obstruction}")
