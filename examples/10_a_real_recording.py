# SPDX-License-Identifier: Apache-2.0
"""
A real recording
================

People hand over a baton (Khanna et al. 2022). Predict the taker's hand from the giver's. The
recordings are public, but we may not ship them; set ``INTENT_SHARED_DATA`` to a folder with the
bags in ``baton`` and their ``dofs.yaml`` (:doc:`../bags`). Without them this page draws nothing.
"""

import os
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import intent_recognition as ir

folder = Path(os.environ.get("INTENT_SHARED_DATA", "../../shared/data")) / "baton"
available = folder.is_dir()
missing = f"no recordings in {folder}: set INTENT_SHARED_DATA. Nothing is drawn below"
print("recordings found" if available else missing)

# %%
# A DOF file says which message fields belong to which agent, and turns bags into demonstrations. Of
# 40 recordings every fourth is kept for testing.

if available:
    bags = sorted(path for path in folder.iterdir() if path.is_dir())[:40]
    recordings, rejected = ir.read_demonstrations(bags, ir.load_dofs(folder / "dofs.yaml"))
    movements = ir.cut_to_movement(recordings)
    training = [m for number, m in enumerate(movements) if number % 4]
    testing = movements[::4]
    library = ir.learn(training, ir.TrainingSettings(segmentation="recording"))
    print(f"{len(training)} to learn from, {len(testing)} to test on, {len(rejected)} rejected")


# %%
# Observe the first part of each movement, and predict the whole movement of the taker's hand. The
# duration is known here, because the movement was recorded; online it is not.


def samples(signals, movement):
    """Times since the beginning (T,) [s] and positions (T, n) of one agent."""
    (signal,) = signals
    during = signal.between(movement.start_ns, movement.end_ns)
    return during.seconds(movement.start_ns), during.values


def predict(movement, share):
    """The taker's trajectory after a share of the movement."""
    times_s, giver = samples(movement.observed, movement)
    seen = times_s <= max(share * movement.duration_s, times_s[0])
    return ir.predict_controlled(
        library, times_s[seen], giver[seen], onset_s=0.0, duration_s=movement.duration_s
    )


def at(trajectory, times_s):
    """Mean positions of a trajectory at some times, (T, n)."""
    columns = [np.interp(times_s, trajectory.times_s, dof) for dof in trajectory.positions.T]
    return np.stack(columns, axis=1)


if available:
    shares = np.linspace(0.0, 1.0, 6)
    errors_cm = np.empty((len(testing), len(shares)))
    for i, movement in enumerate(testing):
        times_s, taker = samples(movement.controlled, movement)
        for j, share in enumerate(shares):
            error = at(predict(movement, share), times_s) - taker
            errors_cm[i, j] = 100 * np.sqrt(np.mean(error**2))

# %%
# Left: one test movement after half of it. Right: the error of the whole path over what was
# observed, one grey line for each test movement.

if available:
    movement = testing[1]
    times_s, taker = samples(movement.controlled, movement)
    predicted = predict(movement, 0.5)
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.5, 3.8), layout="constrained")
    for dof, name in enumerate("xyz"):
        mean, std = predicted.positions[:, dof], predicted.std[:, dof]
        low, high = mean - 2 * std, mean + 2 * std
        left.fill_between(predicted.times_s, low, high, color=f"C{dof}", alpha=0.2, lw=0)
        left.plot(predicted.times_s, mean, color=f"C{dof}", label=f"{name}, ±2σ")
        left.plot(times_s, taker[:, dof], color="black", lw=1.1, ls="--")
    left.axvline(0.5 * movement.duration_s, ymin=0.12, color="0.4", lw=0.8, ls=":")
    left.set(xlabel="time since onset [s]", ylabel="taker's hand [m]", ylim=(-0.6, None))
    left.set_title("predicted from the giver's first half")
    left.legend(loc="lower center", ncols=3)
    right.plot(100 * shares, errors_cm.T, color="0.8", lw=1)
    right.plot(100 * shares, np.mean(errors_cm, axis=0), "o-", color="C0", label="mean")
    right.set(xlabel="observed [%]", ylabel="root mean square error [cm]", ylim=(0, None))
    right.set_title("error of the taker's path")
    right.legend(loc="upper right")
    plt.show()
