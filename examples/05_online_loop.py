# SPDX-License-Identifier: Apache-2.0
"""
An online loop
==============

`IntentEstimator` takes one measurement after the other from a running stream. It finds the onset of
each movement, recognises the task, predicts the robot's movement, and detects the end. `decide`
says when a task is certain enough to act on. The ROS nodes do the same with messages.
"""

import matplotlib.pyplot as plt
import numpy as np
from simulated_handover import TASKS, simulate

import intent_recognition as ir

rng = np.random.default_rng(1)
demonstrations = [
    ir.Demonstration.from_arrays(*simulate(task, rng), task=task, controlled_unit="m")
    for task in TASKS
    for _ in range(8)
]
library = ir.learn(demonstrations)

# %%
# A stream of three movements. In between, the tracker does not see the person for some seconds.

stream, movements, start_s = [], [], 0.0
for task in ("plate", "screw", "screwdriver"):
    times_s, wrist, hand = simulate(task, rng)
    stream += zip(start_s + times_s, wrist, strict=True)
    movements.append((start_s + 0.6, start_s + times_s[-1] - 0.6, hand[-1]))
    start_s += times_s[-1] + 2.5

# %%
# The loop. `decide` is a pure function: its state is an argument and a returned value.
# `predict_controlled` gives the whole interaction under the most probable task: it is None at rest,
# where there is none, and while `none` is the most probable. `predict_controlled_at` says at any
# time where the robot is expected, all tasks together; at rest, where the next movement begins.

estimator = ir.IntentEstimator(library)
settings, state = ir.decision_settings(library), ir.DecisionState()
stamps, probabilities, predicted, active = [], [], [], []
at_rest = estimator.predict_controlled_at(0.0)
print("the robot's hand at rest:", at_rest.positions[0].round(3), "+-", at_rest.std[0].round(3))
for stamp_s, position in stream:
    estimate = estimator.observe(stamp_s, position)
    prediction = estimator.predict_controlled()
    state, task = ir.decide(
        settings,
        state,
        estimate.labels,
        estimate.probabilities,
        estimator.predicted_end_std(),
        estimate.log_evidence,
    )
    stamps.append(stamp_s)
    probabilities.append(estimate.probabilities)
    active.append(task)
    end = np.full((2, 3), np.nan)
    if prediction is not None:
        end = prediction.trajectory.positions[-1], prediction.trajectory.std[-1]
    predicted.append(end)

# %%
# Top: probabilities. Shaded: times in which a task was certain enough to act on. Bottom: the
# predicted end of the robot's hand, and its end in that recording (dashed).

stamps, probabilities = np.array(stamps), np.array(probabilities)
mean, std = np.array(predicted).transpose(1, 0, 2)
figure, (top, bottom) = plt.subplots(2, 1, figsize=(9, 5.4), layout="constrained", sharex=True)
for task, label in enumerate((*library.labels, "none")):
    colour = "0.6" if label == "none" else f"C{task}"
    top.plot(stamps, probabilities[:, task], color=colour, label=label)
    on = np.array(active) == label
    for axes in (top, bottom):
        axes.fill_between(
            stamps,
            0,
            1,
            where=on,
            color=colour,
            alpha=0.12,
            lw=0,
            transform=axes.get_xaxis_transform(),
        )
for dof, name in enumerate("xyz"):
    colour = f"C{dof + 4}"
    low, high = mean[:, dof] - 2 * std[:, dof], mean[:, dof] + 2 * std[:, dof]
    bottom.fill_between(stamps, low, high, color=colour, alpha=0.25, lw=0)
    bottom.plot(stamps, mean[:, dof], color=colour, label=f"{name}, ±2σ")
    for onset_s, end_s, goal in movements:
        bottom.hlines(goal[dof], onset_s, end_s, color=colour, lw=1.2, ls="--")
top.set(ylabel="probability", ylim=(-0.03, 1.05))
bottom.set(xlabel="time [s]", ylabel="robot's hand at the end [m]", ylim=(-0.5, 1.1))
top.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=4)
bottom.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3)
plt.show()
