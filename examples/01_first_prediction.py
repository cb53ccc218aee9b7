# SPDX-License-Identifier: Apache-2.0
"""
From arrays to a prediction
===========================

Learn how a robot moves with a person from recorded arrays. Then observe the first part of a new
movement of the person, and predict the whole movement of the robot.
"""

import matplotlib.pyplot as plt
import numpy as np
from simulated_handover import simulate

import intent_recognition as ir

# %%
# Twenty demonstrations of one task. A `Demonstration` holds what both agents did in one recording.
# These begin and end with the movement; `cut_to_movement` cuts recordings that rest at their ends.

rng = np.random.default_rng(1)
demonstrations = []
for _ in range(20):
    times_s, wrist, hand = simulate("plate", rng, rest_s=0.0)
    demonstration = ir.Demonstration.from_arrays(
        times_s, wrist, hand, task="plate", controlled_unit="m"
    )
    demonstrations.append(demonstration)

# %%
# The primitive is one Gaussian over the weights of all degrees of freedom (DOFs), the person's and
# the robot's (Maeda et al. 2014, Eq. 1, 4 and 5; :doc:`../mathematics`). Its covariance says how
# the two agents go together.

primitive = ir.fit_interaction_promp(demonstrations)
print(primitive.n_dofs, "DOFs,", len(primitive.weights.mean), "weights")
print(f"median duration {primitive.duration_s:.2f} s")

# %%
# A new movement, of which the first 40 % are observed. Conditioning the weights on the person's
# positions gives the distribution of the robot's movement (Eq. 6).

times_s, wrist, hand = simulate("plate", rng, goal=(0.62, 0.05, 0.33), rest_s=0.0)
phase = times_s / times_s[-1]
seen = phase <= 0.4
posterior, log_evidence = primitive.condition(phase[seen], wrist[seen])

# %%
# Grey: what the robot does in this task on average. Colour: what it is predicted to do in this very
# movement. Bands are two standard deviations on either side.

before, after = primitive.predict_controlled(), posterior.predict_controlled()
grid = np.linspace(0.0, 1.0, len(before.times_s))
figure, rows = plt.subplots(3, 1, figsize=(7, 6.4), layout="constrained", sharex=True)
for dof, (axes, name) in enumerate(zip(rows, "xyz", strict=True)):
    for prediction, colour, label in (
        (before, "0.6", "task alone, ±2σ"),
        (after, "C1", "after 40 %, ±2σ"),
    ):
        mean, std = prediction.positions[:, dof], prediction.std[:, dof]
        axes.fill_between(grid, mean - 2 * std, mean + 2 * std, color=colour, alpha=0.2, lw=0)
        axes.plot(grid, mean, color=colour, label=label)
    axes.plot(phase, hand[:, dof], color="black", lw=1.1, ls="--", label="true")
    axes.axvline(0.4, color="0.4", lw=0.8, ls=":")
    axes.set_ylabel(f"robot's hand {name} [m]")
rows[0].annotate(
    "observed until here", (0.4, 0.98), (4, 0), xycoords=("data", "axes fraction"),
    textcoords="offset points", va="top", color="0.35",
)  # fmt: skip
rows[-1].set_xlabel("phase of the movement")
figure.legend(*rows[0].get_legend_handles_labels(), loc="outside upper center", ncols=3)
plt.show()

# %%
# How well it did: the error of the robot's final position, before and after the observation.

for name, prediction in (("task alone", before), ("40 % observed", after)):
    error_cm = 100 * np.linalg.norm(prediction.positions[-1] - hand[-1])
    print(f"{name}: {error_cm:.1f} cm")
