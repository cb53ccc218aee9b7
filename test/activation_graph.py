# SPDX-License-Identifier: Apache-2.0
"""A fake estimator, arm and clock around a real activation node."""

import numpy as np
from hermite import hermite
from joint_trajectories import build_joint_trajectory

from intent_recognition.kinematics.lwr import JOINT_NAMES
from intent_recognition.nodes.conversions import stamp_ns, to_joint_state, trajectory_arrays
from intent_recognition.nodes.diagnostics import values_of
from intent_recognition.nodes.primitive_activation import PrimitiveActivation

HOME = np.array([-0.07, -0.58, -0.47, 1.5, -0.39, 0.94, 0.5])
LABELS = ("plate", "screw", "none")
GOALS = {"plate": np.full(7, 0.4), "screw": np.linspace(-0.5, 0.4, 7)}
START_NS = 50_000_000_000
STEP_NS = 20_000_000


def reference(message, time_ns):
    """Position and velocity a cubic follower of the message has at a time."""
    times, q, rest = trajectory_arrays(message)
    return hermite(times, q, rest["velocities"], (time_ns - stamp_ns(message)) * 1e-9)


def predicted(task, onset_ns, duration_s=2.0, shift=0.0, names=JOINT_NAMES, size=1.0):
    s = np.linspace(0.0, 1.0, 50)
    q = HOME + np.outer(s**3 * (10 - 15 * s + 6 * s**2), size * (GOALS[task] + shift))
    v = np.outer(30 * s**2 * (1 - s) ** 2, size * (GOALS[task] + shift)) / duration_s
    message = build_joint_trajectory(
        names, s * duration_s, q, v, np.full((50, 7), 0.05), time_ns=onset_ns
    )
    message.header.frame_id = task
    return message


class Graph:
    """Fake estimator, of one of several people too, arm and clock around a real node."""

    def __init__(self, harness, person="", **parameters):
        self.harness, self._prefix = harness, f"intent/{person}/".replace("//", "/")
        parameters = {"use_sim_time": True, "home": HOME.tolist(), **parameters}
        given = {name: value for name, value in parameters.items() if value is not None}
        self.node = harness.node(PrimitiveActivation, **given)
        if not self.node._action:
            self.commands = harness.said(self.node, "joint_trajectory")
        self.active = harness.said(self.node, "intent/active_task")
        self.now_ns, self.k = START_NS, 0
        self.task, self.onset_ns, self.shift = "idle", 0, 0.0
        self.speaks = True
        self.tick()

    def seen(self, stream):
        return self.node.diagnostics._totals[stream]

    def hear(self, topic, message):
        self.harness.hear(self.node, topic, message)

    def tick(self):
        self.now_ns += STEP_NS
        self.harness.set_clock(self.node, self.now_ns)
        self.node._timer.callback()

    def probabilities(self):
        if self.task == "idle":
            return [0.0, 0.0, 1.0]
        p = np.full(3, 0.02)
        p[LABELS.index(self.task)] = 0.96
        return p

    def arm(self):
        for message in reversed(self.commands):
            if self.now_ns >= stamp_ns(message):
                return reference(message, self.now_ns)[0]
        return HOME

    def send_joints(self, position=None):
        q = self.arm() if position is None else position
        message = to_joint_state(JOINT_NAMES, q, np.zeros(7), time_ns=self.now_ns)
        self.hear("joint_states", message)

    def send_tasks(self, p=None, time_ns=None, names=LABELS):
        p = self.probabilities() if p is None else p
        time_ns = self.now_ns if time_ns is None else time_ns
        self.hear(f"{self._prefix}tasks", to_joint_state(names, p, time_ns=time_ns))

    def send_prediction(self, message=None):
        message = message or predicted(self.task, self.onset_ns, shift=self.shift)
        self.hear(f"{self._prefix}robot_trajectory", message)

    def step(self):
        """20 ms of the graph: joint states and tasks at 50 Hz, predictions at 25 Hz."""
        self.tick()
        self.k += 1
        self.send_joints()
        if self.speaks:
            if self.task in GOALS and self.k % 2:
                self.shift += 0.004 if self.k % 4 == 1 else -0.003
                self.send_prediction()
            self.send_tasks()

    def run(self, steps):
        for _ in range(steps):
            self.step()

    def until(self, predicate, longest_s=15.0):
        for _ in range(round(longest_s * 1e9 / STEP_NS)):
            if predicate():
                return
            self.step()
        raise AssertionError(f"not within {longest_s} simulated s; mode {self.mode}")

    @property
    def mode(self):
        activation = self.node.activation  # None until the joints are known
        return "idle" if activation is None else activation.mode.value

    def begin(self, task="plate", already_s=0.6):
        self.task, self.onset_ns = task, self.now_ns - round(already_s * 1e9)

    def rejected(self, reason):
        return self.node.diagnostics.rejected(reason)

    def report(self):
        status = self.node.diagnostics.report()
        return status, values_of(status)
