# SPDX-License-Identifier: Apache-2.0
"""
Demonstrations without labels
=============================

Recordings of daily work have no labels. `learn_mixture` finds the tasks in them: it fits mixtures
of interaction primitives by expectation maximisation, and takes the smallest number of components
that predicts left-out demonstrations as well as any other (Ewerton et al. 2015, Algorithm 1;
:doc:`../mixture`).
"""

import matplotlib.pyplot as plt
import numpy as np
from simulated_handover import TASKS, simulate

import intent_recognition as ir

# %%
# Thirty recordings in random order, without labels. The goals vary less than in the other examples:
# three standard deviations are about 10 cm.

rng = np.random.default_rng(1)
truth = rng.permutation(np.repeat(list(TASKS), 10))
goals = [TASKS[task]["goal"] + 0.035 * rng.normal(size=3) for task in truth]
recordings = [
    simulate(task, rng, goal=goal, rest_s=0.0) for task, goal in zip(truth, goals, strict=True)
]
demonstrations = [ir.Demonstration.from_arrays(*r, controlled_unit="m") for r in recordings]

settings = ir.TrainingSettings(n_basis=12)  # smooth movements: few basis functions suffice
library = ir.learn_mixture(demonstrations, settings=settings, rng=rng)
print("components:", ", ".join(library.labels))
print("members:", library.n_demonstrations)

# %%
# The components are tasks like any others: recognise the recordings with them, and compare with the
# true tasks.

found = [
    ir.recognize_task(library, times_s, wrist, duration_s=times_s[-1]).task
    for times_s, wrist, _ in recordings
]
for task in TASKS:
    names, counts = np.unique(np.array(found)[truth == task], return_counts=True)
    print(f"{task:>12}:", ", ".join(f"{n} of {c}" for c, n in zip(names, counts, strict=True)))

# %%
# View from above: as recorded, and coloured by component.

figure, columns = plt.subplots(
    1, 2, figsize=(9, 3.6), layout="constrained", sharex=True, sharey=True
)
for (_, wrist, _), label in zip(recordings, found, strict=True):
    colour = "0.6" if label == "none" else f"C{library.labels.index(label)}"
    columns[0].plot(wrist[:, 0], wrist[:, 1], color="0.45", lw=1.2)
    columns[1].plot(wrist[:, 0], wrist[:, 1], color=colour, lw=1.2)
    columns[1].plot(wrist[-1, 0], wrist[-1, 1], "o", color=colour, ms=4)
columns[0].set(title="recorded", xlabel="wrist x [m]", ylabel="wrist y [m]")
columns[1].set(title="by component", xlabel="wrist x [m]")
for axes in columns:
    axes.set_aspect("equal")
plt.show()
