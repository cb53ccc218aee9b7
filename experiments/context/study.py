# SPDX-License-Identifier: Apache-2.0
"""Handovers at a box that somebody moves, predicted with and without knowing where it stands.

The wrist first goes to a shelf, the same for every place of the box, and turns to the box late. The
robot's hand goes to a place beside the box, which turns with it: not linear in the context.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.evaluation import run_online
from intent_recognition.learning import TrainingSettings, learn
from intent_recognition.promp import TaskLibrary, minimum_jerk
from intent_recognition.recognition import predict_controlled
from intent_recognition.signals import Demonstration, Signal

RATE_HZ = 50.0
"""Sampling rate of a simulated reach [Hz]."""
REST_S = 0.6
"""Rest before and after a reach [s]."""
DURATION_S, DURATION_STD = 2.0, 0.12
NOISE_STD_M = 0.001
GOAL_STD_M = 0.01
"""Standard deviation of the ends of wrist and hand about where box and task put them [m]."""
BOX_M = np.array([[0.35, 0.75], [-0.3, 0.3]])
"""Range of the box's place, x and y [m]."""
TURN_RAD = 0.5
"""The box is turned by at most so much [rad]."""
TURNS_AT = 0.4
"""Share of the movement after which the wrist turns to the box."""
SHELF_M = {"insert": np.array([0.25, 0.2, 0.35]), "fetch": np.array([0.3, -0.15, 0.15])}
BESIDE_M = {"insert": np.array([-0.15, 0.0, 0.12]), "fetch": np.array([0.05, 0.15, 0.05])}
"""Where the hand goes, in the frame of the box [m]."""
HOME_M = np.array([0.9, 0.0, 0.5])
SHARES = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8)
"""Shares of the movement's time seen."""
LATE = 0.2
"""Share of the movement after which the box is known in the third condition."""
WITHOUT, NEVER, LATER, KNOWN = CONDITIONS = (
    "learned without the box",
    "box never known",
    f"box known after {LATE:.0%}",
    "box known",
)


class DrawnSet(NamedTuple):
    """Test results with one set of demonstrations.

    Attributes:
        seed: of the draw.
        end_error_m: of the predicted end of the hand, by condition, (tests, shares).
        inside: share of its coordinates within two predicted standard deviations, by condition,
            (shares,).
        decided: share of the movement at the decision of each test, by condition, (tests,); NaN
            where the task was not acted on.
        wrong: number of tests in which another task was acted on, by condition.
    """

    seed: int
    end_error_m: dict[str, Floats]
    inside: dict[str, Floats]
    decided: dict[str, Floats]
    wrong: dict[str, int]


def investigate(
    seeds: Sequence[int],
    n_train: int,
    n_test: int,
    settings: TrainingSettings | None = None,
    progress: Callable[[float], None] = lambda share: None,
) -> list[DrawnSet]:
    """Learn from so many demonstrations of each task, and predict others; once for each seed."""
    drawn = []
    for number, seed in enumerate(seeds):
        drawn.append(one_set(seed, n_train, n_test, settings))
        progress((number + 1) / len(seeds))
    return drawn


def one_set(
    seed: int, n_train: int, n_test: int, settings: TrainingSettings | None = None
) -> DrawnSet:
    """Learn from demonstrations of one seed, and predict others."""
    rng = np.random.default_rng([seed, 7])
    training = [hand_over(task, rng) for _ in range(n_train) for task in SHELF_M]
    tests = [hand_over(task, rng) for _ in range(n_test) for task in SHELF_M]
    with_box = learn(training, settings)
    without = learn([replace(one, context=()) for one in training], settings)
    collected: list[dict[str, list]] = [{name: [] for name in CONDITIONS} for _ in range(4)]
    errors, inside, decided, wrong = collected
    for one in tests:
        unknown, later = replace(one, context=()), replace(one, context=_said_late(one))
        plain, never, known = (
            _predicted_ends(library, one)
            for library in (without, with_box, with_box.given(one.context_values))
        )
        after = np.array(SHARES)[:, None] >= LATE
        ends = {
            WITHOUT: (plain, without, unknown),
            NEVER: (never, with_box, unknown),
            LATER: (np.where(after, known, never), with_box, later),
            KNOWN: (known, with_box, one),
        }
        for name, ((mean, std), library, shown) in ends.items():
            apart = mean - one.controlled[0].values[-1]
            errors[name].append(np.linalg.norm(apart, axis=1))
            inside[name].append(np.mean(np.abs(apart) < 2.0 * std, axis=1))
            outcome = run_online(library, shown)
            decided[name].append(outcome.decided_share)
            wrong[name].append(bool({*outcome.activated} - {one.task}))
    return DrawnSet(
        seed,
        {name: np.array(rows) for name, rows in errors.items()},
        {name: np.mean(rows, axis=0) for name, rows in inside.items()},
        {name: np.array(shares) for name, shares in decided.items()},
        {name: sum(some) for name, some in wrong.items()},
    )


def hand_over(task: str, rng: np.random.Generator) -> Demonstration:
    """One recording; the box stands and is turned at random."""
    box_m = rng.uniform(*BOX_M.T)
    turn = rng.uniform(-TURN_RAD, TURN_RAD)
    duration_s = DURATION_S * np.exp(DURATION_STD * rng.normal())
    times_s = np.arange(0.0, duration_s + 2.0 * REST_S, 1.0 / RATE_HZ)
    share = (times_s - REST_S) / duration_s
    wrist_m, hand_m = paths(task, share, box_m, turn, rng.normal(size=(2, 3)) * GOAL_STD_M)
    wrist_m = wrist_m + NOISE_STD_M * rng.normal(size=wrist_m.shape)
    found = Demonstration.from_arrays(
        times_s,
        wrist_m,
        hand_m,
        context=box_m,
        context_names=("box_x", "box_y"),
        task=task,
        controlled_unit="m",
        name=f"{task} {rng.integers(2**32):08x}",
    )
    turned = Signal(("box_turn",), found.context[0].stamps_ns, np.array([[turn]]), "rad")
    start_ns, end_ns = (round((REST_S + s) * 1e9) for s in (0.0, duration_s))
    return replace(found, context=(*found.context, turned), start_ns=start_ns, end_ns=end_ns)


def paths(
    task: str, share: Floats, box_m: Floats, turn: float, scatter_m: Floats
) -> tuple[Floats, Floats]:
    """Wrist and hand (T, 3) at shares of the movement [m]."""
    box = np.array([*box_m, 0.1])
    first, late = minimum_jerk(share / 0.75), minimum_jerk((share - TURNS_AT) / (1 - TURNS_AT))
    shelf = SHELF_M[task] + scatter_m[0]
    wrist = first[:, None] * shelf + late[:, None] * (box + scatter_m[0] - shelf)
    cosine, sine = np.cos(turn), np.sin(turn)
    x, y, z = BESIDE_M[task]
    place = box + [cosine * x - sine * y, sine * x + cosine * y, z] + scatter_m[1]
    hand = HOME_M + minimum_jerk((share - 0.1) / 0.9)[:, None] * (place - HOME_M)
    return wrist, hand


def _said_late(one: Demonstration) -> tuple[Signal, ...]:
    """The context, stamped when a share `LATE` of the movement has passed."""
    said_ns = np.array([one.start_ns + round(LATE * (one.end_ns - one.start_ns))])
    return tuple(replace(signal, stamps_ns=said_ns) for signal in one.context)


def _predicted_ends(library: TaskLibrary, one: Demonstration) -> Floats:
    """Mean and standard deviation of the hand's end at each share seen, (2, shares, 3).

    The task is known, the pace is not.
    """
    found = []
    (wrist,) = one.observed
    for share in SHARES:
        seen_ns = one.start_ns + share * (one.end_ns - one.start_ns)
        seen = (wrist.stamps_ns >= one.start_ns) & (wrist.stamps_ns <= seen_ns)
        if share > 0.0:
            times_s, values = wrist.stamps_ns[seen] * 1e-9, wrist.values[seen]
            end = predict_controlled(library, times_s, values, task=one.task, n_points=1)
        else:
            task = library.labels.index(str(one.task))
            end = library.primitive(task).predict_controlled(2)
        found.append((end.positions[-1], end.std[-1]))
    return np.swapaxes(found, 0, 1)
