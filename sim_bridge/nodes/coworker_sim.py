# SPDX-License-Identifier: Apache-2.0
"""The node `coworker_sim`: simulated workers, and a simulated tracker of their wrists."""

from collections.abc import Mapping
from functools import partial
from typing import Any

from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from rclpy.time import Time
from rclpy.timer import Timer
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String

from intent_recognition.errors import ArgumentError
from intent_recognition.nodes.diagnostics import Diagnostics, Level, Readiness
from intent_recognition.nodes.parameters import declare
from intent_recognition.nodes.people import named_people
from intent_recognition.nodes.qos import SENSOR, STATE
from intent_recognition.nodes.runtime import run, steady_timer
from sim_bridge.coworker import RATE_HZ, SessionPlan, SessionTiming, parse_task_list, plan_people
from sim_bridge.scenarios.assembly import of_worker, plan_live

SAMPLE_NS = round(1e9 / RATE_HZ)
"""Time between two samples [ns]."""


class _Worker:
    """Publishes one person's samples and labels as their time comes."""

    def __init__(
        self, node: Node, plan: SessionPlan, person: str, diagnostics: Diagnostics, frame: str
    ) -> None:
        prefix = f"{person}/" if person else ""
        self.plan, self._topic = plan, f"mocap/{prefix}wrist/pose"
        self._progress, self._diagnostics = f"interaction {person}".strip(), diagnostics
        self.poses = node.create_publisher(PoseStamped, self._topic, SENSOR)
        self._tasks = node.create_publisher(String, f"coworker/{prefix}task", STATE)
        self._labels = _label_schedule(plan)
        self._next_label = self._next_sample = 0
        self._message = PoseStamped()
        self._message.header.frame_id = frame

    def tick(self, first_ns: int, now_ns: int) -> bool:
        """Publish the samples whose time has come; return whether more will follow."""
        samples = self.plan.samples
        due = min((now_ns - first_ns + 500_000) // SAMPLE_NS + 1, len(samples.times_s))
        last = min(due, self._next_sample + 8)  # fewer than queues hold (`qos.SENSOR`)
        for k in range(self._next_sample, last):
            self._announce(k * SAMPLE_NS)
            if samples.visible[k]:
                self._publish(first_ns, k)
            else:
                self._diagnostics.count("occluded")
        self._next_sample = max(self._next_sample, last)
        return self._next_sample < len(samples.times_s)

    def end(self) -> None:
        """Publish an empty label at the end of the session."""
        self._tasks.publish(String(data=""))

    def _announce(self, elapsed_ns: int) -> None:
        while self._next_label < len(self._labels):
            at_ns, label, number = self._labels[self._next_label]
            if at_ns > elapsed_ns:
                return
            self._tasks.publish(String(data=label))
            self._next_label += 1
            self._diagnostics.value(self._progress, f"{number} of {len(self.plan.interactions)}")

    def _publish(self, first_ns: int, k: int) -> None:
        message, samples = self._message, self.plan.samples
        message.header.stamp = Time(nanoseconds=first_ns + k * SAMPLE_NS).to_msg()
        position, turn = message.pose.position, message.pose.orientation
        position.x, position.y, position.z = samples.positions_m[k].tolist()
        turn.x, turn.y, turn.z, turn.w = samples.orientations[k].tolist()
        self.poses.publish(message)
        self._diagnostics.tick(self._topic)


class CoworkerSim(Node):
    """Publishes a planned session, sample by sample, as time passes.

    Out: `mocap/wrist/pose`, whose sample k is stamped exactly 10 k ms after the first one, in this
    node's ROS time; `coworker/task`, the label when a reach begins and an empty string when it
    ends, and the new label when the worker changes their mind (ground truth, for scoring only);
    `/diagnostics`. With `persons`, each person has their own topics, `mocap/<person>/wrist/pose`
    and `coworker/<person>/task`.

    The session begins when the clock runs, or waits for this node's answer, the nodes in
    `wait_for_nodes` are ready and `wait_for_subscribers` nodes subscribe to the poses. With
    `exit_at_end`, the node ends with the session.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("coworker_sim", **kwargs)
        values = declare(self, "coworker_sim")
        people = named_people(self) or [""]
        plans = _make_plans(values, len(people))
        self._wait_for = values["wait_for_subscribers"]
        nodes = values["wait_for_nodes"]
        self._exit_at_end = values["exit_at_end"]
        self.done = False
        self.diagnostics = Diagnostics(self)
        self.diagnostics.ready = False
        self._readiness = Readiness(self, nodes)
        self._waits_for = ""
        self.workers = [
            _Worker(self, plan, person, self.diagnostics, values["frame_id"])
            for plan, person in zip(plans, people, strict=True)
        ]
        self.first_stamp_ns = 0
        self._timer: Timer | None = None
        if self.get_parameter("use_sim_time").value:
            self.create_subscription(Clock, "/clock", self._on_clock, STATE)
        self._start_timer = steady_timer(self, 0.02, self._start)

    def _start(self) -> None:
        now_ns = self.get_clock().now().nanoseconds
        if waits_for := self._missing(now_ns):
            if waits_for != self._waits_for:
                self._waits_for = waits_for
                self.get_logger().info(f"waiting for {waits_for}")
                self.diagnostics.status(Level.WARN, f"waiting for {waits_for}")
            return
        self._start_timer.cancel()
        self._timer = self.create_timer(SAMPLE_NS * 1e-9, self._on_timer)
        self.diagnostics.status(Level.OK, "running")
        self.diagnostics.ready = True
        if not self.diagnostics.answers:  # else `_on_clock` begins with the next time
            self._tick(now_ns)

    def _missing(self, now_ns: int) -> str:
        if now_ns <= 0 and not self.diagnostics.answers:  # else time begins with its answer
            return "/clock"
        if nodes := self._readiness.missing():
            return f"{', '.join(nodes)} (wait_for_nodes)"
        n_subscribers = min(worker.poses.get_subscription_count() for worker in self.workers)
        n_missing = self._wait_for - n_subscribers
        return f"{n_missing} subscribers of the poses" if n_missing > 0 else ""

    def _on_timer(self) -> None:
        if not self.diagnostics.answers:  # else time waits for `_on_clock`
            self._tick(self.get_clock().now().nanoseconds)

    def _on_clock(self, message: Clock) -> None:
        self.diagnostics.tick("/clock")
        if self.diagnostics.answers and self._timer is not None and not self._timer.is_canceled():
            self._tick(message.clock.sec * 1_000_000_000 + message.clock.nanosec)

    def _tick(self, now_ns: int) -> None:
        self.first_stamp_ns = self.first_stamp_ns or now_ns
        go_on = [worker.tick(self.first_stamp_ns, now_ns) for worker in self.workers]
        if any(go_on):
            return
        if self._timer is not None:
            self._timer.cancel()
        for worker in self.workers:
            worker.end()
        self.diagnostics.end("session over")
        self.done = self._exit_at_end


def _make_plans(values: Mapping[str, Any], n_people: int) -> tuple[SessionPlan, ...]:
    seed, task_list, count = values["seed"], values["task_list"], values["interactions"]
    timing = SessionTiming(
        first_idle_s=values["first_idle"],
        idle_s=_shortest_and_longest(values, "idle"),
        hold_s=_shortest_and_longest(values, "hold"),
        last_idle_s=values["last_idle"],
        gaps_per_s=values["occlusions"],
    )
    if values["scenario"] == "assembly":
        return (of_worker(plan_live(seed, task_list, count, timing)),)
    lists = task_list.split(";")
    if len(lists) not in (1, n_people):
        cure = "Give one for all, or one for each."
        raise ArgumentError.about("task_list", f"{n_people} lists", len(lists), cure)
    each = [lists[k % len(lists)] for k in range(n_people)]
    return plan_people(seed, [parse_task_list(one, seed, count) for one in each], timing)


def _shortest_and_longest(values: Mapping[str, Any], name: str) -> tuple[float, float]:
    times_s = values[name]
    if len(times_s) != 2 or not 0.1 <= times_s[0] <= times_s[1]:
        cure = "Give the shortest and the longest."
        raise ArgumentError.about(f"parameter {name}", "two times, 0.1 s or more", times_s, cure)
    return times_s[0], times_s[1]


def _label_schedule(plan: SessionPlan) -> list[tuple[int, str, int]]:
    """Labels to publish, in order: time [ns] after the first sample, label, interaction number."""
    schedule = []
    for number, interaction in enumerate(plan.interactions, 1):
        begun_as = interaction.changed_from or interaction.task
        schedule.append((round(interaction.onset_s * 1e9), begun_as, number))
        if interaction.changed_from:
            schedule.append((round(interaction.change_s * 1e9), interaction.task, number))
        schedule.append((round(interaction.end_s * 1e9), "", number))
    return schedule


main = partial(run, CoworkerSim)
