# SPDX-License-Identifier: Apache-2.0
"""
Movements that nobody taught
============================

A person sometimes scratches their head. Beside the tasks there is always the hypothesis `none`:
any human movement, with a wider distribution than every task. Evidence counts only beyond a margin
that is learned from tasks left out in training (:doc:`../recognition`), so `none` wins when a
movement fits no task.
"""

import matplotlib.pyplot as plt
import numpy as np
from simulated_handover import TASKS, minimum_jerk, simulate

import intent_recognition as ir

rng = np.random.default_rng(1)
demonstrations = [
    ir.Demonstration.from_arrays(*simulate(task, rng), task=task, controlled_unit="m")
    for task in TASKS
    for _ in range(8)
]
library = ir.learn(demonstrations)


# %%
# Three movements: one of the tasks; one to a place where nothing is handed over; and one that
# begins like a task and turns back.


def reach(goal, duration_s=1.5):
    """A straight reach from the usual start, (T,) [s] and (T, 3) [m]."""
    times_s = np.arange(0.0, duration_s, 0.02)
    way = minimum_jerk(times_s / duration_s)[:, None]
    return times_s, np.array([0.1, 0.0, 0.0]) + way * (np.array(goal) - [0.1, 0.0, 0.0])


times_s, plate, _ = simulate("plate", rng, rest_s=0.0)
movements = {
    "a plate": (times_s, plate),
    "to the head": reach((-0.1, 0.1, 0.5)),
    "a plate, then back": (
        times_s,
        np.concatenate([plate[: len(plate) // 2], plate[: len(plate) - len(plate) // 2][::-1]]),
    ),
}

# %%
# The probability of the tasks, one colour each, and of `none` in grey.

figure, columns = plt.subplots(1, 3, figsize=(10, 3.3), layout="constrained", sharey=True)
for axes, (name, (times_s, wrist)) in zip(columns, movements.items(), strict=True):
    counts = range(1, len(times_s) + 1, 2)
    estimates = [ir.recognize_task(library, times_s[:n], wrist[:n]) for n in counts]
    times = times_s[np.array(counts) - 1]
    shares = np.array([estimate.probabilities for estimate in estimates])
    colours = [*(f"C{k}" for k in range(library.n_tasks)), "0.75"]
    axes.stackplot(times, shares.T, colors=colours, labels=estimates[0].labels, lw=0)
    axes.set(title=name, xlabel="time since onset [s]", ylim=(0, 1), xlim=(0, times[-1]))
    axes.grid(visible=False)
    print(f"{name}: {estimates[-1].task} at the end")
columns[0].set_ylabel("probability")
figure.legend(*columns[0].get_legend_handles_labels(), loc="outside upper center", ncols=4)
plt.show()
