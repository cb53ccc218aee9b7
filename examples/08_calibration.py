# SPDX-License-Identifier: Apache-2.0
"""
Uncertainty and its calibration
===============================

A standard deviation is calibrated if errors are as large as it says, and a probability if the event
happens as often as it says. Both are checked here on new movements.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.stats import norm
from simulated_handover import TASKS, simulate

import intent_recognition as ir

rng = np.random.default_rng(1)


def demonstrate(task):
    """One demonstration without rest."""
    return ir.Demonstration.from_arrays(
        *simulate(task, rng, rest_s=0.0), task=task, controlled_unit="m"
    )


# %%
# Standard deviations
# -------------------
# Predict the robot in 100 new movements, 40 % of each observed, and count how often it stays
# within k predicted standard deviations. Five demonstrations determine the spread less well than
# twenty, so the covariance is inflated (:doc:`../decisions/covariance_target`).

normal = np.linspace(0.0, 3.0, 61)
coverage = {}
for n_demonstrations in (5, 20):
    primitive = ir.fit_interaction_promp([demonstrate("plate") for _ in range(n_demonstrations)])
    scaled = []
    for _ in range(100):
        times_s, wrist, hand = simulate("plate", rng, rest_s=0.0)
        phase = times_s / times_s[-1]
        posterior, _ = primitive.condition(phase[phase < 0.4], wrist[phase < 0.4])
        predicted = posterior.predict_controlled(n_points=len(phase))
        scaled.append(np.abs(predicted.positions - hand)[-1] / predicted.std[-1])
    coverage[n_demonstrations] = [np.mean(np.array(scaled) < k) for k in normal]
    print(f"{n_demonstrations} demonstrations: {coverage[n_demonstrations][40]:.0%} within 2 sigma")

# %%
# Probabilities
# -------------
# Learn three tasks, ask early in 150 new movements which one it is, and compare the probability of
# each task with the share in which it was the task. `reliability_bins` sorts them into bins.

library = ir.learn([demonstrate(task) for task in TASKS for _ in range(8)])
said, true = [], []
for number in range(150):
    task = list(TASKS)[number % 3]
    times_s, wrist, _ = simulate(task, rng, rest_s=0.0)
    n_seen = 3 + number % 8
    estimate = ir.recognize_task(library, times_s[:n_seen], wrist[:n_seen])
    known = estimate.probabilities[:-1] / estimate.probabilities[:-1].sum()
    said += known.tolist()
    true += [label == task for label in library.labels]
probability, share, count = ir.reliability_bins(np.array(said), np.array(true), n_bins=5)

# %%
# On the diagonal, the uncertainty is calibrated. Above it on the left, errors are smaller than the
# predicted standard deviation.

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
for axes in (left, right):
    axes.plot([0, 1], [0, 1], color="0.5", lw=1, ls="--")
    axes.set(xlim=(0, 1), ylim=(0, 1.02), aspect="equal")
for colour, (n_demonstrations, shares) in zip(("C1", "C0"), coverage.items(), strict=True):
    label = f"{n_demonstrations} demonstrations"
    left.plot(2 * norm.cdf(normal) - 1, shares, color=colour, label=label)
left.set(xlabel="share that k σ should hold", ylabel="share held")
left.set_title("final position of the robot")
left.legend(loc="lower right")
right.plot(probability, share, "o-", color="C0")
for x, y, n in zip(probability, share, count, strict=True):
    right.annotate(f"{n}", (x, y), (6, -11), textcoords="offset points", color="0.35", fontsize=8.5)
right.set(xlabel="probability given to a task", ylabel="share in which it was the task")
right.set_title("task, early in the movement")
plt.show()
