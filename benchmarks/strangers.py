# SPDX-License-Identifier: Apache-2.0
"""`python -m benchmarks.strangers [--seed N]`: agents and people whom the model did not expect.

`late`: a robot hand copies, as a critically damped system does, a hand that wanders along splines.
`people`: five people of their own height, reach, bow and tempo reach for three goals; each is left
out. `unnamed`: no recording names them. `exact`: the robot meets a hand that reaches with a bow
exactly where its own rule says. `pushes`: the velocity of the robot follows a force, for a while.
The generators share nothing with the filter.
"""

import argparse
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline, make_interp_spline

from intent_recognition.array_types import Floats
from intent_recognition.evaluation import evaluate, make_folds
from intent_recognition.promp import minimum_jerk
from intent_recognition.signals import Demonstration

SHARES, EARLY = ("0.25", "0.5", "0.75", "1.0"), ("0.1", "0.2", "0.3")


def copies(
    rng: np.random.Generator, n_tasks: int = 3, n: int = 14, stiffness: float = 15.0
) -> Iterator[Demonstration]:
    """The robot follows some 0.25 s later: 0.12 s of delay, and 2 / stiffness."""
    usual, step_s = 0.25 * rng.normal(size=(n_tasks, 6, 3)), 1e-3
    for task, number in np.ndindex(n_tasks, n):
        duration_s = 2.5 * np.exp(0.2 * rng.normal())
        times_s = np.arange(0.0, 0.7 + duration_s, step_s)
        points = np.vstack([np.zeros(3), usual[task] + 0.12 * rng.normal(size=(6, 3))])
        course = make_interp_spline(np.linspace(0.0, 1.0, 7), points, 3)
        hand = course(minimum_jerk((times_s - 0.4) / duration_s))
        place, velocity, robot = hand[0], np.zeros(3), np.empty_like(hand)
        for k in range(len(times_s)):
            apart = hand[max(k - 120, 0)] - place
            velocity = velocity + step_s * stiffness * (stiffness * apart - 2.0 * velocity)
            robot[k] = place = place + step_s * velocity
        yield _recorded(rng, times_s[::10], hand[::10], robot[::10], f"task_{task}", number)


def people(
    rng: np.random.Generator, n_people: int = 5, n_tasks: int = 3, n: int = 5
) -> Iterator[Demonstration]:
    """Each person does each task some times."""
    goals = rng.uniform([0.3, -0.3, -0.1], [0.7, 0.3, 0.3], size=(n_tasks, 3))
    home = np.array([1.2, 0.0, 0.5])
    for person in range(n_people):
        height, bow = 0.06 * rng.normal(size=3), 0.05 * rng.normal(size=3)
        length, tempo = np.exp([0.12, 0.25] * rng.normal(size=2))
        for task, number in np.ndindex(n_tasks, n):
            duration_s = 1.8 * tempo * np.exp(0.1 * rng.normal())
            times_s = np.arange(0.0, 0.8 + duration_s, 1 / 60)
            goal = goals[task] * length + height + 0.025 * rng.normal(size=3)
            ahead, later = (
                minimum_jerk((times_s - start_s) / duration_s)[:, None] for start_s in (0.5, 0.65)
            )
            hand = height + ahead * (goal - height) + bow * np.sin(np.pi * ahead)
            there = goals[task] * [-1, 1, 1] + [1.4, 0, 0] + 0.9 * (goal - goals[task])
            robot, who = home + later * (there - home), f"person_{person}"
            yield _recorded(rng, times_s, hand, robot, f"task_{task}", number, who)


def exact(rng: np.random.Generator, n_tasks: int = 4, n: int = 16) -> Iterator[Demonstration]:
    """The robot sets out after 0.3 of a reach; where it goes is linear in where the hand goes."""
    goals = rng.uniform([0.3, -0.4, -0.2], [0.7, 0.4, 0.4], size=(n_tasks, 3))
    bows, home = 0.06 * rng.normal(size=(n_tasks, 3)), np.array([1.2, 0.0, 0.5])
    for task, number in np.ndindex(n_tasks, n):
        duration_s = 2.0 * np.exp(0.2 * rng.normal())
        times_s = np.arange(0.0, 0.6 + 1.3 * duration_s, 0.01)
        goal = goals[task] + 0.05 * rng.normal(size=3)
        share = ((times_s - 0.3) / duration_s)[:, None]
        ahead, later = minimum_jerk(share), minimum_jerk(share - 0.3)
        bow = bows[task] * (1.0 + 0.2 * rng.normal())
        hand = ahead * goal + bow * np.sin(np.pi * ahead)
        there = goals[task] * [-1, 1, 1] + [1.4, 0, 0] + 0.9 * (goal - goals[task])
        robot = home + later * (there - home)
        yield _recorded(rng, times_s, hand, robot, f"task_{task}", number)


def pushes(rng: np.random.Generator, n_tasks: int = 3, n: int = 14) -> Iterator[Demonstration]:
    """A force takes its course in 1 to 5 s, and the robot goes where it is pushed."""
    yields, ends = np.array([[0.03, 0.006], [-0.004, 0.025]]), np.zeros((1, 2))
    usual = [
        6.0 * rng.normal(size=(4, 2)) + rng.choice([-4, 4], size=(1, 2)) for _ in range(n_tasks)
    ]
    for task, number in np.ndindex(n_tasks, n):
        duration_s = 2.2 * np.exp(0.35 * rng.normal())
        times_s = np.arange(0.0, duration_s + 0.8, 1e-3)
        size, change = np.exp(0.2 * rng.normal()), 1.2 * rng.normal(size=(6, 2))
        points = np.vstack([ends, size * usual[task] + change[1:-1], ends])
        course = CubicSpline(np.linspace(0.0, 1.0, 6), points, bc_type="clamped")
        force = course(np.clip((times_s - 0.4) / duration_s, 0.0, 1.0))
        robot = np.cumsum(force @ yields.T, axis=0) * 1e-3
        yield _recorded(
            rng, times_s[::10], force[::10], robot[::10], f"task_{task}", number, unit="N"
        )


def _recorded(
    rng: np.random.Generator,
    times_s: Floats,
    hand: Floats,
    robot: Floats,
    task: str,
    number: int,
    who: str = "",
    unit: str = "m",
) -> Demonstration:
    """With the noise of a tracker, or of a sensor of forces."""
    hand = hand + (0.001 if unit == "m" else 0.05) * rng.normal(size=hand.shape)
    robot = robot + 0.001 * rng.normal(size=robot.shape)
    names = {"name": f"{task}_{who}_{number}", "group": who, "observed_unit": unit}
    return Demonstration.from_arrays(times_s, hand, robot, task=task, controlled_unit="m", **names)


def main(arguments: list[str] | None = None) -> None:
    """Print errors in cm, and how well tasks are recognised."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    seed = parser.parse_args(arguments).seed
    for name, made, protocol in (
        ("late", copies, "kfold:4"),
        ("exact", exact, "kfold:4"),
        ("people", people, "logo:group"),
        ("unnamed", people, "logo:group"),
        ("pushes", pushes, "kfold:4"),
    ):
        recorded = list(made(np.random.default_rng(seed)))
        folds = make_folds(recorded, protocol)
        if name == "unnamed":
            recorded = [replace(one, metadata={}) for one in recorded]
        result = evaluate(recorded, folds, unknown_tasks=False)
        for phase, scores in result["prediction"].items():
            found = result["recognition"][phase]
            print(
                name,
                phase,
                "cm",
                *(f"{100 * scores[share]['rmse']:.1f}" for share in SHARES),
                "nearest",
                *(f"{100 * scores[share]['rmse_nearest_neighbour']:.1f}" for share in SHARES),
                "inside 2 sigma",
                *(f"{scores[share]['coverage_2_sigma']:.2f}" for share in SHARES),
                "accuracy, log loss",
                *(f"{found[s]['accuracy']:.2f} {found[s]['log_loss']:.2f}" for s in EARLY),
            )


if __name__ == "__main__":
    main()
