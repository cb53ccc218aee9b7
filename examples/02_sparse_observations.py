# SPDX-License-Identifier: Apache-2.0
"""
Sparse and partial observations
===============================

A tracker loses its marker, or sees only one coordinate. What was not measured has no row in the
observation matrix (Maeda et al. 2014, Eq. 7 and 8): nothing is interpolated, and no noise is
inflated instead. Any number of samples, at any phases, of any DOFs, can be used.
"""

import matplotlib.pyplot as plt
import numpy as np
from simulated_handover import simulate

import intent_recognition as ir

rng = np.random.default_rng(1)
demonstrations = [
    ir.Demonstration.from_arrays(*simulate("plate", rng, rest_s=0.0), controlled_unit="m")
    for _ in range(20)
]
primitive = ir.fit_interaction_promp(demonstrations)

# %%
# One new movement, observed in four ways. `dofs` names the measured DOFs; the observed ones come
# first, so 2 is the height of the wrist.

times_s, wrist, hand = simulate("plate", rng, goal=(0.62, 0.05, 0.33), rest_s=0.0)
phase = times_s / times_s[-1]
few = np.searchsorted(phase, [0.25, 0.5, 0.8])
seen = {
    "nothing": ([], None),
    "one sample": (few[1:2], None),
    "three samples": (few, None),
    "three heights": (few, [2]),
}
predictions = {}
for name, (rows, dofs) in seen.items():
    posterior = primitive
    if len(rows):
        values = wrist[rows] if dofs is None else wrist[np.ix_(rows, dofs)]
        posterior, _ = primitive.condition(phase[rows], values, dofs=dofs)
    predictions[name] = posterior

# %%
# The person's forward motion x and height z. Knowing only heights narrows the height, and the
# forward motion as far as it is correlated with the height.

grid = np.linspace(0.0, 1.0, 50)
figure, table = plt.subplots(
    2, 4, figsize=(10, 4.6), layout="constrained", sharex=True, sharey="row"
)
for column, (name, posterior) in zip(table.T, predictions.items(), strict=True):
    predicted, (rows, dofs) = posterior.predict_observed(), seen[name]
    column[0].set_title(name)
    for axes, dof in zip(column, (0, 2), strict=True):
        mean, std = predicted.positions[:, dof], predicted.std[:, dof]
        axes.fill_between(grid, mean - 2 * std, mean + 2 * std, color="C0", alpha=0.2, lw=0)
        axes.plot(grid, mean, color="C0", label="predicted, ±2σ")
        axes.plot(phase, wrist[:, dof], color="black", lw=1.1, ls="--", label="true")
        if len(rows) and dofs in (None, [dof]):
            axes.plot(phase[rows], wrist[rows, dof], "o", color="C1", ms=6, label="measured")
table[0, 0].set_ylabel("wrist x [m]")
table[1, 0].set_ylabel("wrist z [m]")
figure.supxlabel("phase of the movement", fontsize=9.5)
figure.legend(*table[0, 1].get_legend_handles_labels(), loc="outside upper center", ncols=3)
plt.show()

# %%
# The effect on the robot: the standard deviation of its final position.

for name, posterior in predictions.items():
    std_cm = 100 * posterior.predict_controlled().std[-1]
    print(f"{name:>14}: x {std_cm[0]:.1f} cm, y {std_cm[1]:.1f} cm, z {std_cm[2]:.1f} cm")
