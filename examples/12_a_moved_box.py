# SPDX-License-Identifier: Apache-2.0
"""
A moved box
===========

The handover takes place beside a box, whose position is known before anybody moves. Such a context
conditions the prediction as soon as it is known; it may come late, or never.
"""

import matplotlib.pyplot as plt
import numpy as np
from simulated_handover import simulate

import intent_recognition as ir

rng = np.random.default_rng(1)


def hand_over(box):
    """Arrays of one handover: the wrist reaches to within a centimetre of the box."""
    return simulate("plate", rng, goal=[*box, 0.25] + 0.01 * rng.normal(size=3))


# %%
# Twelve demonstrations, each with the place of the box, x and y, as its context.

boxes = rng.uniform([0.4, -0.2], [0.7, 0.3], size=(12, 2))
library = ir.learn(
    [
        ir.Demonstration.from_arrays(
            *hand_over(box),
            context=box,
            context_names=("box_x", "box_y"),
            task="plate",
            controlled_unit="m",
        )
        for box in boxes
    ]
)

# %%
# Two estimators follow a new handover, at a place that was never shown. One of them is given the
# place before it begins. Given later, it would have the same effect from then on.

box = np.array([0.45, 0.25])
times_s, wrist, hand = hand_over(box)
informed, uninformed = ir.IntentEstimator(library), ir.IntentEstimator(library)
informed.observe_context(box)
errors = {"box known": [], "box unknown": []}
for stamp_s, position in zip(times_s, wrist, strict=True):
    for estimator, found in zip((informed, uninformed), errors.values(), strict=True):
        estimator.observe(stamp_s, position)
        prediction = estimator.predict_controlled(n_points=1)
        if prediction is not None:
            end_m = prediction.trajectory.positions[-1]
            found.append((stamp_s, 100 * np.linalg.norm(end_m - hand[-1])))

# %%
# Left: the error of the predicted end of the robot's hand. Right: the end that the library predicts
# before any movement, with two standard deviations.

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.4), layout="constrained")
for colour, (name, found) in zip(("C0", "C1"), errors.items(), strict=True):
    left.plot(*np.transpose(found), color=colour, label=name)
left.set(xlabel="time [s]", ylabel="error of the predicted end [cm]", ylim=(0, None))
left.legend()
for colour, name, known in zip(("C0", "C1"), errors, (library.given(box), library), strict=True):
    end = known.primitive(0).predict_controlled(2)
    mean, std = end.positions[-1], end.std[-1]
    right.errorbar(*mean[:2], 2 * std[1], 2 * std[0], "o", color=colour, label=name)
right.plot(*hand[-1, :2], "x", color="black", label="where it was")
right.set(xlabel="x [m]", ylabel="y [m]", title="the hand's end, before the movement")
right.legend()
plt.show()
