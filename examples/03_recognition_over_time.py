# SPDX-License-Identifier: Apache-2.0
"""
Recognition over time
=====================

Learn three tasks, then ask after each sample of a new movement which task it is. The evidence of
all samples so far is kept (Maeda et al. 2014, Eq. 9 to 11). The duration of the movement is not
known, and one alternative is always that the movement is none of the tasks.
"""

import matplotlib.pyplot as plt
import numpy as np
from simulated_handover import TASKS, simulate

import intent_recognition as ir

# %%
# `learn` fits one primitive per label, with timing and noise. It chooses the scale of the noise by
# leaving demonstrations out.

rng = np.random.default_rng(1)
demonstrations = [
    ir.Demonstration.from_arrays(*simulate(task, rng), task=task, controlled_unit="m")
    for task in TASKS
    for _ in range(8)
]
library = ir.learn(demonstrations)
print("tasks:", ", ".join(library.labels))
print("durations:", ", ".join(f"{duration:.1f} s" for duration in library.durations_s))

# %%
# `recognize_task` takes the movement from its onset on, in whole or in part.

times_s, wrist, _ = simulate("screwdriver", rng, rest_s=0.0)
counts = range(1, len(times_s) + 1)
estimates = [ir.recognize_task(library, times_s[:n], wrist[:n]) for n in counts]
print(f"after 0.5 s: {estimates[25].task}, {max(estimates[25].probabilities):.0%}")

# %%
# Every task begins alike, so the first samples say little: probabilities begin at the prior and
# change as soon as the movements of the tasks differ.

probabilities = np.array([estimate.probabilities for estimate in estimates])
figure, (top, bottom) = plt.subplots(
    2, 1, figsize=(7, 5.2), layout="constrained", sharex=True, height_ratios=(1, 1.3)
)
for dof, name in enumerate("xyz"):
    top.plot(times_s, wrist[:, dof], color="0.35", lw=1.3)
    top.annotate(f" {name}", (times_s[-1], wrist[-1, dof]), va="center", color="0.35")
top.set_ylabel("wrist [m]")
for task, label in enumerate(estimates[0].labels):
    colour = "0.6" if label == "none" else f"C{task}"
    bottom.plot(times_s, probabilities[:, task], color=colour, label=label)
bottom.set(xlabel="time since onset [s]", ylabel="probability", ylim=(-0.03, 1.05))
figure.legend(*bottom.get_legend_handles_labels(), loc="outside upper center", ncols=4)
plt.show()

# %%
# A known duration determines the phase, which removes much of the uncertainty. It is rarely known
# online, but in a recording it is.

half = len(times_s) // 4
for name, duration_s in (("unknown", None), ("known", float(times_s[-1]))):
    found = ir.recognize_task(library, times_s[:half], wrist[:half], duration_s=duration_s)
    print(f"duration {name}: {found.task_probabilities['screwdriver']:.3f} after a quarter")
