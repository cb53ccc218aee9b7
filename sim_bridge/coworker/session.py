# SPDX-License-Identifier: Apache-2.0
"""A working session of the coworker: a pure function of its seed, so that a scorer can repeat it.

Each interaction: rest, reach (onset to end), hold while the robot comes, retract to a new resting
place, rest.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml
from numpy.typing import NDArray

from intent_recognition.errors import ArgumentError, describe
from sim_bridge.coworker.habit import habitual_tasks
from sim_bridge.coworker.reach import Reach, draw_reach, draw_rest, draw_retract
from sim_bridge.coworker.styles import STYLES, TASKS
from sim_bridge.coworker.timeline import WristSamples, sample_wrist


@dataclass(frozen=True)
class SessionTiming:
    """The parts of a session that are not movement, all in seconds.

    Attributes:
        first_idle_s: rest before the first reach.
        idle_s: shortest and longest rest between a retract and the next reach.
        hold_s: shortest and longest wait for the robot at the end of a reach.
        last_idle_s: rest at the end of the session.
        gaps_per_s: occlusions per second.
    """

    first_idle_s: float = 2.0
    idle_s: tuple[float, float] = (1.5, 2.1)
    hold_s: tuple[float, float] = (1.25, 1.4)
    last_idle_s: float = 2.0
    gaps_per_s: float = 0.08


@dataclass(frozen=True)
class Interaction:
    """Ground truth of one interaction, for scoring; times are since the session's first sample.

    Attributes:
        task: label.
        onset_s: start of the reach.
        end_s: end of the reach.
        goal_m: where the wrist stops, (3,), world.
        reach: the movement.
    """

    task: str
    onset_s: float
    end_s: float
    goal_m: NDArray[np.float64]
    reach: Reach


@dataclass(frozen=True)
class SessionPlan:
    """A planned session.

    Attributes:
        samples: what the tracker sees, 100 Hz.
        interactions: the ground truth, in order.
    """

    samples: WristSamples
    interactions: tuple[Interaction, ...]


def parse_task_list(task_list: str, seed: int, interactions: int) -> tuple[str, ...]:
    """Turn a node's `task_list` parameter into labels.

    Args:
        task_list: "random" (every task equally often, in random order), "habit" (in the
            coworker's habitual order, with variation), labels separated by commas, or a text or
            YAML file with a list of labels.
        seed: of the order.
        interactions: how many; a given list is repeated or cut to that number, and 0 takes a
            given list as it is (40 for "random" and "habit").

    Raises:
        ArgumentError: an unknown label, an empty list, or a file that is neither.
    """
    if interactions < 0:
        raise ArgumentError(
            describe("interactions", "0 or more", interactions, "Give the number of reaches.")
        )
    text = task_list.strip()
    if text == "habit":
        return habitual_tasks(seed, interactions or 40)
    if text == "random":
        count = interactions or 40
        rng = np.random.default_rng([seed, 7])
        dealt = [TASKS[k % len(TASKS)] for k in range(count)]
        return tuple(dealt[k] for k in rng.permutation(count))
    labels = _labels_of(text)
    unknown = sorted({label for label in labels if label not in STYLES})
    if not labels or unknown:
        raise ArgumentError(
            describe(
                "task_list",
                f"labels of {sorted(STYLES)}, a file of them, 'random' or 'habit'",
                unknown or repr(task_list),
                "Correct the labels or the path.",
            )
        )
    if not interactions:
        return labels
    return tuple(labels[k % len(labels)] for k in range(interactions))


def _labels_of(text: str) -> tuple[str, ...]:
    """Labels of a comma separated text or of a file."""
    if text and "," not in text and text not in STYLES and Path(text).is_file():
        try:
            content = yaml.safe_load(Path(text).read_text(encoding="utf-8"))
        except (yaml.YAMLError, UnicodeDecodeError) as error:
            raise ArgumentError(
                describe("task_list", "a text or YAML file", text, f"Repair it: {error}.")
            ) from error
        if isinstance(content, dict):
            content = content.get("task_list", content.get("tasks", []))
        if isinstance(content, list):
            return tuple(str(label) for label in content)
        text = str(content or "").replace(" ", ",")
    return tuple(label.strip() for label in text.split(",") if label.strip())


def plan_session(
    seed: int, tasks: Sequence[str], timing: SessionTiming | None = None
) -> SessionPlan:
    """Plan a session through `tasks` with new goals, starts, curves and speeds.

    The same arguments give the same plan, bit for bit; sample k is taken 10 k ms after the first.

    Args:
        seed: of all variation; other seeds, other movements.
        tasks: labels in order, at least one.
        timing: rests and holds; the defaults if None.

    Raises:
        ArgumentError: an unknown label, or no task at all.
    """
    if not tasks:
        raise ArgumentError(
            describe("tasks", "at least one label", "none", f"Name some of {sorted(STYLES)}.")
        )
    timing = timing or SessionTiming()
    rng = np.random.default_rng([seed, 2])
    wrist, now = draw_rest(rng), timing.first_idle_s
    movements: list[tuple[float, Reach]] = []
    interactions = []
    for task in tasks:
        reach = draw_reach(rng, task, wrist)
        end = now + reach.duration_s
        interactions.append(Interaction(task, now, end, reach.goal_m, reach))
        retract = draw_retract(rng, reach.goal_m)
        back = end + rng.uniform(*timing.hold_s)
        movements += [(now, reach), (back, retract)]
        wrist, now = retract.goal_m, back + retract.duration_s + rng.uniform(*timing.idle_s)
    last = movements[-1]
    length = last[0] + last[1].duration_s + timing.last_idle_s
    samples = sample_wrist(rng, movements, length, gaps_per_s=timing.gaps_per_s)
    return SessionPlan(samples, tuple(interactions))
