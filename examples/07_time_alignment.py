# SPDX-License-Identifier: Apache-2.0
"""
Time alignment
==============

People run through one movement at different speeds. `align` finds for each demonstration a smooth,
increasing map from the phase of a common reference to its own (Maeda et al. 2014, Eq. 15 and 16;
:doc:`../alignment`). Unlike dynamic time warping it does not stop or jump.
"""

import matplotlib.pyplot as plt
import numpy as np
from simulated_handover import simulate

import intent_recognition as ir

# %%
# Twelve handovers of a plate, some faster at the beginning, some at the end. Trajectories may
# differ in length; their samples are even in time.

rng = np.random.default_rng(3)
trajectories = []
for _ in range(12):
    _, wrist, _ = simulate("plate", rng, rest_s=0.0)
    phase = np.linspace(0.0, 1.0, len(wrist))
    hurried = phase + rng.uniform(-0.08, 0.08) * np.sin(np.pi * phase) ** 2 * np.pi
    trajectories.append(np.stack([np.interp(hurried, phase, dof) for dof in wrist.T], axis=1))

alignment = ir.align(trajectories)

# %%
# Left: height over recorded phase. Middle: the same over the reference's phase. Right: the warps.

grid = np.linspace(0.0, 1.0, alignment.aligned.shape[1])
figure, (before, after, warps) = plt.subplots(1, 3, figsize=(10, 3.4), layout="constrained")
for trajectory, aligned, warp in zip(trajectories, alignment.aligned, alignment.warps, strict=True):
    before.plot(np.linspace(0.0, 1.0, len(trajectory)), trajectory[:, 2], color="C0", lw=1)
    after.plot(grid, aligned[:, 2], color="C0", lw=1)
    warps.plot(grid, warp.apply(grid), color="C0", lw=1)
warps.plot([0, 1], [0, 1], color="black", lw=1, ls="--")
after.sharey(before)
before.set(title="recorded", xlabel="recorded phase", ylabel="wrist z [m]")
after.set(title="aligned", xlabel="reference phase")
warps.set(title="warps", xlabel="reference phase", ylabel="recorded phase")
plt.show()

# %%
# The remaining differences are in place. Standard deviation across the demonstrations in the middle
# of the movement, where timing matters most:

resampled = np.array(
    [
        [np.interp(grid, np.linspace(0.0, 1.0, len(t)), dof) for dof in t.T]
        for t in trajectories
    ]
).transpose(0, 2, 1)  # fmt: skip
middle = (grid > 0.3) & (grid < 0.6)
for name, values in (("recorded", resampled), ("aligned", alignment.aligned)):
    std_cm = 100 * values[:, middle].std(axis=0, ddof=1).mean(axis=0)
    print(f"{name:>9}: x {std_cm[0]:.1f} cm, y {std_cm[1]:.1f} cm, z {std_cm[2]:.1f} cm")
