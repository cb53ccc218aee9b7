# SPDX-License-Identifier: Apache-2.0
"""Rest, the movement under way, and another that may have begun where the hand last stopped.

A worker may reach for the next goal on the way back from the last, without a rest. At a momentary
stop, a new filter starts. It takes over once it recognises a task, if the movement under way was
done or unknown at the stop and still is, and does not explain what follows as well. If it
recognises nothing, as after a wave of the hand or a hesitation, the movement under way continues.
"""

from collections.abc import Callable, Iterable
from functools import partial

import numpy as np

from intent_recognition.filtering import STOP_LEAD, MovementFilter, PriorGrid, TaskPosterior
from intent_recognition.promp import TaskLibrary
from intent_recognition.recognition.decision import USUAL_THRESHOLD
from intent_recognition.recognition.motion_detection import MotionDetector, is_overdue
from intent_recognition.recognition.transitions import Expectation
from intent_recognition.signals import Observation

DONE_PHASE = 0.85
"""Expected phase of the movement under way from which another may have begun."""


class Movements:
    """Rest, the movement under way, and the next one, which may have begun.

    Args:
        detector: onset, stops and end of movements.
        expectation: prior of the tasks, updated at the end of each movement.
        switching: that of `IntentEstimator`.

    Attributes:
        run: filter of the movement under way; None at rest.
        posterior: its posterior at the last observation, weighed with `expectation`.
    """

    _filter: MovementFilter  # of a movement that begins at rest
    run: MovementFilter | None = None
    posterior: TaskPosterior | None = None

    def __init__(self, detector: MotionDetector, expectation: Expectation, *, switching: bool):
        self._detector, self._expectation = detector, expectation
        self._switching = switching

    def use(
        self, library: TaskLibrary, grid: PriorGrid, turned: Callable[[Observation], Observation]
    ) -> None:
        """Switch to a library; filter the movement under way anew, its observations `turned`."""
        followed = self.run is not None and self.run is not self._filter
        switching, margin = self._switching, library.stop_margin
        make = partial(MovementFilter, library, onset_ns=0, prune=True, switching=switching)
        self._filter = make(grid=grid)
        after = grid if margin is None else grid._replace(none_margin=margin)
        self._make = partial(make, grid=after)
        self._after_stop: MovementFilter | None = None  # made at the first stop
        self._stopped = False
        self._at_onset = self._at_stop = float(np.log(1.0 / library.none_prior - 1.0))
        self._log_odds = [(0, self._at_onset)]  # stamps and log odds of the movement under way
        usual_s = float(np.exp(np.mean(library.log_duration_mean)))
        self._lead_ns = round(STOP_LEAD * usual_s * 1e9)
        if self.run is not None:
            seen = [turned(observation) for observation in self.run.observations]
            begun = self._make() if followed else self._filter
            self.begin(self.run.onset_ns, seen, begun)
            self.believe(seen[-1].stamp_ns)

    def begin(
        self, onset_ns: int, past: Iterable[Observation], run: MovementFilter | None = None
    ) -> None:
        """Follow a movement from its onset, given its observations so far.

        `run` is its filter if it followed another without a rest.
        """
        self.run = run or self._filter
        self.run.restart(onset_ns, self._expectation.ratio, past)
        self._stopped = False
        self._log_odds = [(onset_ns, self._at_onset)]
        self._detector.forget_stops()

    def believe(self, stamp_ns: int) -> TaskPosterior | None:
        """Bring the posterior of the movement under way up to a stamp; None at rest."""
        if self.run is not None:
            self.posterior = self._expectation.weigh(self.run.posterior(stamp_ns))
        return self.posterior

    def advance(self, observation: Observation, *, begun: bool) -> None:
        """Take an observation, which `begin` has taken if the movement has just `begun`.

        It may show that the movement is over, or that the next one is under way.
        """
        stamp_ns, detector = observation.stamp_ns, self._detector
        if self.run is not None and not begun and stamp_ns >= self.run.onset_ns:
            self.run.observe(observation)
        posterior = self.believe(stamp_ns)
        elapsed_s = 0.0 if self.run is None else (stamp_ns - self.run.onset_ns) * 1e-9
        if posterior is not None and detector.ends(elapsed_s, posterior):
            self._end(stamp_ns)
        elif self._switching and (posterior is not None or detector.waits_for_rest):
            following = self._following(observation, posterior)
            if following is not None:
                self._end(stamp_ns)
                self.run = following
                self.believe(stamp_ns)

    def forget(self) -> None:
        """Forget the movement under way."""
        self.run = self.posterior = None

    def _end(self, stamp_ns: int) -> None:
        """End the movement under way, and remember its task."""
        if self.posterior is not None:
            self._expectation.remember(stamp_ns, self.posterior)
        self.forget()

    def _following(
        self, observation: Observation, posterior: TaskPosterior | None
    ) -> MovementFilter | None:
        """Filter of a movement that began at the last stop, if it takes over now; else None.

        `posterior` is that of the movement so far, after the newest observation; None if this was
        overdue.
        """
        detector, expected = self._detector, self._expectation.ratio
        stopped_ns, done = detector.stopped_ns(), is_done(posterior)
        if posterior is not None and posterior.log_odds != self._log_odds[-1][1]:
            self._log_odds.append((observation.stamp_ns, posterior.log_odds))
        if stopped_ns is not None:
            self._stopped = done
            before = (odds for ns, odds in reversed(self._log_odds) if ns < stopped_ns)
            self._at_stop = next(before, self._at_onset)
        if not self._stopped:
            return None
        after = self._after_stop = self._after_stop or self._make()
        if stopped_ns is not None:
            after.restart(stopped_ns - self._lead_ns, expected, detector.since(stopped_ns))
        else:
            after.observe(observation)
        next_one = after.posterior(observation.stamp_ns)
        gained = next_one.log_odds - self._at_onset
        better = posterior is None or gained > posterior.log_odds - self._at_stop
        known = 1.0 - next_one.probabilities[-1]
        if not (done and better and known >= USUAL_THRESHOLD):  # as for a decision
            elapsed_s = (observation.stamp_ns - after.onset_ns) * 1e-9
            self._stopped = not is_overdue(elapsed_s, next_one)
            return None
        self._after_stop = None
        self._log_odds = [(after.onset_ns, self._at_onset)]
        self._stopped = detector.waits_for_rest = False
        return after


def is_done(posterior: TaskPosterior | None) -> bool:
    """Whether another movement may have begun: this one is done or unknown."""
    if posterior is None:
        return True
    best = int(np.argmax(posterior.probabilities))
    return best == len(posterior.probabilities) - 1 or bool(posterior.phase[best] >= DONE_PHASE)
