# SPDX-License-Identifier: Apache-2.0
"""What hypotheses that were born on the way make of a movement, between two observations."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class SwitchedBelief(NamedTuple):
    """What born hypotheses make of a movement's task and timing; zero where there are none.

    Attributes:
        log_joint: log of prior and density of all observations, of the K tasks and none, (K + 1,).
        staying: log probability with which a task of the onset passed nothing on.
        duration_s: expected duration given the task, (K + 1,).
        task: number of the task of each hypothesis, (n,).
        weight: their probabilities given the task, (n,).
        begin_s: when the course of each began, after onset, (n,).
        course_s: how long it takes, (n,).
    """

    log_joint: NDArray[np.float64]
    staying: float
    duration_s: NDArray[np.float64]
    task: NDArray[np.int64]
    weight: NDArray[np.float64]
    begin_s: NDArray[np.float64]
    course_s: NDArray[np.float64]

    def phase(self, elapsed_s: float) -> NDArray[np.float64]:
        """Expected phase given the task, so long after onset, (K + 1,)."""
        phase = np.minimum(np.maximum((elapsed_s - self.begin_s) / self.course_s, 0.0), 1.0)
        expected = np.bincount(self.task, self.weight * phase, len(self.log_joint))
        return expected.astype(np.float64)
