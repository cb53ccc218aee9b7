# SPDX-License-Identifier: Apache-2.0
"""The human half of one demonstration: rest, reach, hold."""

from dataclasses import dataclass

import numpy as np

from sim_bridge.coworker import TASKS, Reach, WristSamples, draw_reach, draw_rest, sample_wrist

OCCLUSION_PROBABILITY = 0.4
"""Share of demonstrations in which the tracker loses the marker now and then."""
SETTLE_S = 0.5
"""How long the recording goes on after the robot's arrival [s]."""
TRAINING_COUNTS = {TASKS[0]: 15, TASKS[1]: 20, TASKS[2]: 13}
"""Demonstrations per task to learn from, 48 in all."""
TEST_COUNTS = dict.fromkeys(TASKS, 4)
"""Recordings per task that nothing is learned from."""


@dataclass(frozen=True)
class WristDemonstration:
    """Rest, one reach, and hold until the robot has come.

    Attributes:
        reach: the movement.
        onset_s: start of the movement, in seconds since the first sample.
        end_s: end of the movement, in the same time.
        arrival_s: when the demonstrator lets the robot arrive, in the same time.
        samples: what the tracker saw.
    """

    reach: Reach
    onset_s: float
    end_s: float
    arrival_s: float
    samples: WristSamples


def plan_demonstration(rng: np.random.Generator, task: str) -> WristDemonstration:
    """Draw one demonstration of a task.

    The robot arrives about a quarter of the movement's duration after its end, 0.3 to 0.95 s.
    """
    onset = round(rng.uniform(0.65, 1.0), 3)
    reach = draw_reach(rng, task, draw_rest(rng))
    end = onset + reach.duration_s
    arrival = end + float(np.clip(rng.normal(0.24, 0.02) * reach.duration_s, 0.3, 0.95))
    occluded = rng.uniform() < OCCLUSION_PROBABILITY
    gaps_per_s = 1.5 / (arrival + SETTLE_S) if occluded else 0.0
    samples = sample_wrist(rng, [(onset, reach)], arrival + SETTLE_S, gaps_per_s=gaps_per_s)
    return WristDemonstration(reach, onset, end, arrival, samples)


def demonstration_rng(seed: int, purpose: int, task: str, index: int) -> np.random.Generator:
    """The generator of one demonstration: the same whatever else is drawn, and in any order."""
    return np.random.default_rng([seed, purpose, TASKS.index(task), index])
