# SPDX-License-Identifier: Apache-2.0
"""
Combining primitives
====================

A learned primitive is a distribution, and distributions can be changed and combined after learning
(Paraschos et al. 2013 and 2018): the robot's hand passes over a bottle that stands in its way, one
motion combines two tasks, or another task takes over during the motion.
"""

import matplotlib.pyplot as plt
import numpy as np
from simulated_handover import simulate

import intent_recognition as ir

rng = np.random.default_rng(1)
plate, screw = (
    ir.fit_interaction_promp(
        [
            ir.Demonstration.from_arrays(*simulate(task, rng, rest_s=0.0), controlled_unit="m")
            for _ in range(20)
        ]
    )
    for task in ("plate", "screw")
)

# %%
# **Via points.** The wrist has been observed for 40 % of the movement, so the robot knows where to
# go. A bottle stands in its way: in the middle of the motion the hand must be 10 cm higher, and
# still begin and end where it would have. DOF 5 is the height of the hand; the three observed DOFs
# come first. The estimate of the person does not change: a requirement on the robot is no evidence.

times_s, wrist, hand = simulate("plate", rng, goal=(0.6, 0.1, 0.3), rest_s=0.0)
phase = times_s / times_s[-1]
seen = slice(0, np.searchsorted(phase, 0.4), 4)
expected, _ = plate.condition(phase[seen], wrist[seen])
free = expected.predict_controlled()
middle_s = 0.55 * plate.duration_s
height = np.interp(middle_s, free.times_s, free.positions[:, 2]) + 0.1
bent = ir.via_point(expected, middle_s, [height], dofs=[5])
for point_s, position in ((0.0, free.positions[0]), (plate.duration_s, free.positions[-1])):
    bent = ir.via_point(bent, point_s, position)
over = bent.predict_controlled()

# %%
# **Co-activation.** The product of two primitives is a compromise, nearer to the one with the
# smaller variance. With activations that sum to one, a primitive combined with itself is unchanged.

both = ir.co_activate([plate, screw], [0.5, 0.5])

# %%
# **Blending.** The hand sets out for the plate, and between 0.3 and 1.3 s the screw takes over.
# Position and velocity change smoothly, and the velocity is the derivative of the position. A
# primitive with a smaller variance dominates earlier.

grid_s = np.linspace(0.0, 1.6, 161)
activations, rates = ir.smooth_switch(grid_s, at_s=0.8, over_s=1.0)
changed = ir.blend([plate, screw], grid_s, activations, rates=rates)
alone = [ir.blend([plate, screw], grid_s, np.tile(row, (grid_s.size, 1))) for row in np.eye(2)]

# %%
# The robot's hand: its height with and without the bottle, its motion to the side for both tasks
# and their product, and the same with its velocity as one task takes over from the other.


def tube(axes, x, mean, std, colour, label, **line):
    """A mean and two standard deviations."""
    axes.fill_between(x, mean - 2 * std, mean + 2 * std, color=colour, alpha=0.15, lw=0)
    axes.plot(x, mean, color=colour, label=label, **line)


figure, (first, second, third, fourth) = plt.subplots(1, 4, figsize=(12, 3.1), layout="constrained")
for found, colour, label in ((free, "C0", "as learned"), (over, "C3", "over the bottle")):
    tube(first, found.times_s, found.positions[:, 2], found.std[:, 2], colour, label)
first.plot(middle_s, height, "o", color="black", ms=4, label="via point")
first.set(xlabel="time [s]", ylabel="hand's height z [m]", title="via point")
for one, colour, label in ((plate, "C0", "plate"), (screw, "C1", "screw"), (both, "C2", "both")):
    found = one.predict_controlled()
    tube(second, found.times_s, found.positions[:, 1], found.std[:, 1], colour, label)
second.set(xlabel="time [s]", ylabel="hand to the side y [m]", title="co-activation")
for axes, name, title in (
    (third, "positions", "blending: position"),
    (fourth, "velocities", "blending: velocity"),
):
    for found, colour, label in zip(alone, ("C0", "C1"), ("plate", "screw"), strict=True):
        axes.plot(grid_s, getattr(found, name)[:, 1], color=colour, ls="--", lw=1.2, label=label)
    axes.plot(grid_s, getattr(changed, name)[:, 1], color="C2", lw=1.8, label="blended")
    axes.axvspan(0.3, 1.3, color="0.93", zorder=0)
    axes.set(xlabel="time [s]", title=title)
third.set_ylabel("y [m]")
fourth.set_ylabel("dy/dt [m/s]")
for axes in (first, second, third):
    axes.legend(fontsize=7.5)
plt.show()

# %%

apart_cm = 100 * np.linalg.norm(over.positions - free.positions, axis=1)
print(f"over the bottle: {apart_cm.max():.1f} cm away at most, {apart_cm[-1]:.1f} cm at the end")
fastest = np.abs(changed.velocities[:, 1]).max()
print(f"to the side, the blended hand moves at {fastest:.2f} m/s at most")
for axis, name in enumerate("xyz"):
    ends = [one.predict_controlled() for one in (plate, screw, both)]
    ends_m = ", ".join(f"{e.positions[-1, axis]:+.2f} ± {e.std[-1, axis]:.2f}" for e in ends)
    print(f"end {name} of plate, screw, both [m]: {ends_m}")
