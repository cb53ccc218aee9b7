# SPDX-License-Identifier: Apache-2.0
"""
The simulated handovers
=======================

The other examples work on these arrays. A person rests, reaches for a place, and rests again; the
robot's hand goes to meet the person's hand. The place and the path there depend on the task; the
place, the pace and the start differ from one recording to the next. The robot's goal follows from
the person's goal, so predicting the wrist is enough to know where to send the robot.

Replace `simulate` by your own recordings: times (T,) in seconds, and positions (T, n) of the
person's and of the robot's degrees of freedom.
"""

import numpy as np

RATE_HZ = 50.0
REST_S = 0.6  # before and after each movement
NOISE_M = 0.001  # standard deviation of a measured position
GOAL_STD_M = 0.05  # standard deviation of the places that a person reaches for

# Mean goal [m], deviation from the straight line [m], and median duration [s].
TASKS = {
    "plate": {"goal": (0.55, 0.15, 0.25), "bow": (0.0, 0.0, 0.1), "duration_s": 1.6},
    "screw": {"goal": (0.45, -0.20, 0.05), "bow": (0.0, -0.08, 0.02), "duration_s": 1.2},
    "screwdriver": {"goal": (0.50, 0.05, 0.1), "bow": (0.0, 0.1, -0.03), "duration_s": 1.4},
}


def minimum_jerk(share):
    """Share of the way after a share of the time (Flash and Hogan 1985); at rest outside [0, 1]."""
    share = np.clip(share, 0.0, 1.0)
    return share**3 * (10.0 - 15.0 * share + 6.0 * share**2)


def simulate(task, rng, *, goal=None, duration_s=None, rest_s=REST_S):
    """One recording of a person and the robot.

    Args:
        task: a name in `TASKS`.
        rng: random numbers.
        goal: where the person reaches, (3,) [m]; None draws a place.
        duration_s: of the movement; None draws one.
        rest_s: before and after the movement.

    Returns:
        Times (T,) [s], positions of the person's wrist (T, 3) [m], and of the robot's hand
        (T, 3) [m].
    """
    known = TASKS[task]
    if goal is None:
        goal = known["goal"] + GOAL_STD_M * rng.normal(size=3)
    if duration_s is None:
        duration_s = known["duration_s"] * np.exp(0.12 * rng.normal())
    times_s = np.arange(0.0, duration_s + 2.0 * rest_s, 1.0 / RATE_HZ)
    share = np.clip((times_s - rest_s) / duration_s, 0.0, 1.0)
    share = share + 0.5 * rng.normal() * share**2 * (1.0 - share) ** 2  # not all hurry alike
    way = minimum_jerk(share)[:, None]
    start = np.array([0.1, 0.0, 0.0]) + 0.01 * rng.normal(size=3)
    bow = known["bow"] + 0.01 * rng.normal(size=3)
    wrist = start + way * (goal - start) + np.sin(np.pi * way) * bow
    home, meeting = np.array([1.1, 0.0, 0.4]), np.asarray(goal) + [0.12, 0.0, 0.05]
    hand = home + minimum_jerk(1.15 * share - 0.15)[:, None] * (meeting - home)
    noise = NOISE_M * rng.normal(size=(2, *wrist.shape))
    return times_s, wrist + noise[0], hand + noise[1]


# %%
# Eight recordings of each task, viewed from the side and from above. Lines end where person and
# robot meet.

if __name__ == "__main__":
    import matplotlib.pyplot as plt

    rng = np.random.default_rng(1)
    figure, views = plt.subplots(1, 2, figsize=(9.4, 3.0), layout="constrained", sharex=True)
    for colour, task in enumerate(TASKS):
        for number in range(8):
            _, wrist, hand = simulate(task, rng)
            for axes, row in zip(views, (2, 1), strict=True):
                label = task if number == 0 else None
                axes.plot(wrist[:, 0], wrist[:, row], color=f"C{colour}", lw=1.2, label=label)
                axes.plot(hand[:, 0], hand[:, row], color=f"C{colour}", lw=1.0, ls=(0, (4, 2)))
                axes.plot(wrist[-1, 0], wrist[-1, row], "o", color=f"C{colour}", ms=3.5)
    for axes, name, middle in zip(
        views, ("up: z [m]", "to the left: y [m]"), (0.2, 0.0), strict=True
    ):
        axes.set(xlabel="forward: x [m]", ylabel=name, aspect="equal")
        axes.set(xlim=(-0.15, 1.3), ylim=(middle - 0.33, middle + 0.33))
        robot_at = (1.1, 0.4 if middle else 0.0)
        axes.annotate("person ", (0.08, 0.0), ha="right", va="center")
        axes.annotate("  robot", robot_at, ha="left", va="center")
    figure.legend(*views[0].get_legend_handles_labels(), loc="outside upper center", ncols=3)
    plt.show()
