# SPDX-License-Identifier: Apache-2.0
"""
A pull that is felt
===================

A person reaches for a plate that the robot holds, to take it or to press it against a screw. The
wrist does the same in both; what differs is the force on the plate, which a sensor measures beside
the tracker. In a DOF file it is one more entry: ``config/examples/wrench.dofs.yaml``.
"""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
from simulated_handover import minimum_jerk, simulate

import intent_recognition as ir

rng = np.random.default_rng(4)
FORCES_N = {"take": np.array([6.0, 0.0, 3.0]), "press": np.array([-8.0, 0.0, -1.0])}


def recording(task):
    """One recording: the force grows in the last third of the reach, and the robot gives way."""
    times_s, wrist, hand = simulate("plate", rng)
    done = minimum_jerk(2.0 * times_s / times_s[-1] - 0.9)[:, None]
    force = done * FORCES_N[task] * np.exp(0.2 * rng.normal())
    force += 0.3 * rng.normal(size=force.shape)
    hand = hand + done * ([0.1, 0.0, 0.0] if task == "take" else [0.0, 0.0, 0.0])
    stamps_ns = np.round(1e9 * (1.0 + times_s)).astype(np.int64)
    return ir.Demonstration(
        name=task,
        source="simulated",
        task=task,
        observed=(
            ir.Signal(("wrist x", "wrist y", "wrist z"), stamps_ns, wrist, "m"),
            ir.Signal(("force x", "force y", "force z"), stamps_ns, force, "N"),
        ),
        controlled=(ir.Signal(("hand x", "hand y", "hand z"), stamps_ns, hand, "m"),),
        start_ns=int(stamps_ns[0]),
        end_ns=int(stamps_ns[-1]),
    )


# %%
# Twelve demonstrations of each task are learned, with the force and without it.

demonstrations = [recording(task) for task in FORCES_N for _ in range(12)]
both = ir.learn(demonstrations)
wrist_only = ir.learn([replace(one, observed=one.observed[:1]) for one in demonstrations])

# %%
# A new plate is taken. Two estimators follow it; one of them feels the force.

shown = recording("take")
wrist, force = shown.observed
feels, looks = ir.IntentEstimator(both), ir.IntentEstimator(wrist_only)
probability = {"wrist and force": [], "wrist alone": []}
for stamp_ns, position, newtons in zip(wrist.stamps_ns, wrist.values, force.values, strict=True):
    estimates = [looks.observe(stamp_ns * 1e-9, position), feels.observe(stamp_ns * 1e-9, position)]
    estimates[1] = feels.observe(stamp_ns * 1e-9, newtons, signal=1)
    for found, estimate in zip(reversed(probability.values()), estimates, strict=True):
        found.append(dict(zip(estimate.labels, estimate.probabilities, strict=True))["take"])

# %%
# Left: the measured force. Right: the probability of the right task.

times_s = wrist.seconds(shown.start_ns)
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
left.plot(times_s, force.values, label=["x", "y", "z"])
left.set(xlabel="time [s]", ylabel="force of the person [N]")
left.legend()
for label, values in probability.items():
    right.plot(times_s, values, label=label)
right.set(xlabel="time [s]", ylabel="probability of take", ylim=(0.0, 1.02))
right.legend()
plt.show()
