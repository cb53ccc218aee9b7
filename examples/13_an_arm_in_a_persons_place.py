# SPDX-License-Identifier: Apache-2.0
"""
An arm in a person's place
==========================

Two people assemble a box. The second person's wrist is learned and predicted, and the joints of an
arm follow from its predicted path (Maeda et al. 2014, Fig. 7-9). The nodes do the same with any
arm: ``intent demo --scenario assembly --arm panda``. Here the arm is the LWR, read from its URDF,
which needs pinocchio (``pip install pin``).
"""

import matplotlib.pyplot as plt
import numpy as np

import intent_recognition as ir
from intent_recognition.kinematics import Arm
from intent_recognition.motion import joints_along
from intent_recognition.share import share_path

# %%
# One shipped session has forty interactions. The last one is kept for testing; the others are
# learned wrist to wrist.

dofs = ir.load_dofs(share_path("config/dofs_two_humans.yaml"))
recordings, _ = ir.read_demonstrations(share_path("bags/assembly/session_00"), dofs)
library = ir.learn(recordings[:-1])
recording = recordings[-1]
worker, assistant = recording.observed[0], recording.controlled[0]
print(f"learned {', '.join(library.labels)}; shown now: {recording.task}")

# %%
# Give the estimator the worker's wrist, as a tracker would. As soon as a task is clear, it predicts
# the whole path of the other wrist ten times a second, and more and more accurately.

estimator = ir.IntentEstimator(library)
predictions = []
for number, (stamp_ns, wrist) in enumerate(zip(worker.stamps_ns, worker.values)):
    estimate = estimator.observe(stamp_ns * 1e-9, wrist)
    clear = estimate.moving and estimate.probabilities.max() > 0.95 and estimate.task != "none"
    if clear and number % 10 == 0:
        at_s = (stamp_ns - recording.start_ns) * 1e-9
        predictions.append((at_s, estimate.task, estimator.predict_controlled()))
decided_s, task, _ = predictions[0]
print(f"{decided_s:.2f} s: {task}")

# %%
# The arm's joints follow from each path: its hand begins where the assistant rests, and redundant
# joints stay near that posture.

arm = Arm.from_urdf(share_path("config/robots/lwr.urdf"), tip="lwr_hand")
elbow_up = [0.0, -0.45, 0.0, 1.55, 0.0, -1.14, 0.0]
end = assistant.values[-20:].mean(axis=0)
ends_cm = []
for *_, prediction in predictions:
    path = prediction.trajectory
    home = arm.inverse_kinematics(path.positions[0], elbow_up, elbow_up)
    times_s, joints = joints_along(arm, path.times_s, path.positions, home)
    hand = arm.forward_kinematics(joints)[:, :3, 3]
    ends_cm.append(100 * np.linalg.norm(hand[-1] - end))
print(f"the hand would end {ends_cm[0]:.1f} cm from where the wrist did, at last {ends_cm[-1]:.1f}")

# %%
# Left: the arm's hand in the last prediction, and the wrist whose place it takes. Middle: the
# distance between their ends, over the time of the prediction. Right: the arm's joints.

since_s = prediction.onset_ns * 1e-9 - recording.start_ns * 1e-9
figure, (left, middle, right) = plt.subplots(1, 3, figsize=(12, 3.8), layout="constrained")
for dof, name in enumerate("xyz"):
    left.plot(since_s + times_s, hand[:, dof], color=f"C{dof}", label=f"hand {name}")
    seconds = assistant.seconds(recording.start_ns)
    left.plot(seconds, assistant.values[:, dof], color="black", lw=1.1, ls="--")
left.set(xlabel="time [s]", ylabel="position [m]", title="dashed: the second person's wrist")
left.set_ylim(-0.35, None)
left.legend(loc="lower center", ncols=3, fontsize="small")
middle.plot([at_s for at_s, *_ in predictions], ends_cm)
middle.set(xlabel="predicted at [s]", ylabel="hand from wrist at the end [cm]", ylim=(0, None))
right.plot(since_s + times_s, joints)
right.set(xlabel="time [s]", ylabel="joint angle [rad]", title="the arm's joints")
plt.show()
