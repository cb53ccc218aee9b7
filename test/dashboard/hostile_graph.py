# SPDX-License-Identifier: Apache-2.0
"""The page's node among nodes that note what is asked of them, and browsers on it."""

import asyncio

import numpy as np
from dashboard.browser import free_port
from dashboard.guarded import Visited, send, update
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory

from intent_recognition.composing import ViaPoint
from intent_recognition.dashboard import browser_messages, server
from intent_recognition.dashboard.cell import SkillRow
from intent_recognition.dashboard.commands import ESTIMATOR, TEACHER
from intent_recognition.dashboard.node import Dashboard
from intent_recognition.kinematics import JOINT_NAMES
from intent_recognition.model import TO_KEEP, TO_UNDO
from intent_recognition.nodes import qos
from intent_recognition.plans import read_plan

SERVICES = ("start", "stop", "learn", "discard", "undo", "keep", "accept", "save_plan")
SAVE = SERVICES[-1]
TASK = "plate"
POINT = ViaPoint("here", {"hand": (0.2, 0.1, 0.05)}, (0.01,) * 3, 0.5, None, TASK)
PLAN = "steps: [{step: base}, {step: lid}]\n"
PATH = (TASK, np.outer(np.linspace(0.0, 1.0, 5), [0.4, 0.2, 0.1]))
DEADLINE_S = 20.0


class Graph:
    """The page's node among nodes that note what is asked of them; nothing of it is believed."""

    def __init__(self, harness, **values):
        self.harness, self.heard = harness, []
        self.port = free_port()
        overrides = {"port": self.port, "rate": 60.0, "models": "/nowhere"} | values
        self.node = harness.node(Dashboard, **overrides)
        self.page, self.timers = self.node.page, len(list(self.node.timers))
        for name, parameters in (
            (TEACHER, {"task": "", "learn_at_stop": True}),
            (ESTIMATOR, {"via_points": "", "plan": ""}),
        ):
            other = harness.add(Node(name))
            for parameter, value in parameters.items():
                other.declare_parameter(parameter, value)
            other.add_on_set_parameters_callback(self._set)
        for service in SERVICES:
            name = f"{ESTIMATOR if service == SAVE else TEACHER}/{service}"
            harness.probe.create_service(Trigger, name, lambda _, a, s=service: self._called(s, a))
        for kind, topic, profile in (
            (DiagnosticStatus, "intent/feedback", qos.FEEDBACK),
            (PoseStamped, "mocap/wrist/pose", qos.SENSOR),
            (JointTrajectory, "joint_trajectory", qos.COMMAND),
        ):
            note = lambda message, topic=topic: self.heard.append((topic, message))  # noqa: E731
            harness.probe.create_subscription(kind, topic, note, profile)
        page, state = self.page, self.node.state
        state.take_joints(JOINT_NAMES, [0.1] * 7, np.inf)
        state.skills = {TASK: [SkillRow("learned 00", {TO_KEEP: "yes", TO_UNDO: "yes"})]}
        harness.spin_until(lambda: page._teach._record.visible and not page._skills._undo.disabled)

    def begin(self):
        """A task is executed, via point and plan in force, the predicted path to be dragged."""
        state = self.node.state
        state.active, state.via_points, state.plan = TASK, (POINT,), read_plan(PLAN)
        self.page._scene.hand_path = PATH
        self.page._via._drag.value = True
        skills, via = self.page._skills, self.page._via
        self.harness.spin_until(lambda: skills._thumbs.visible and via._handle.visible)
        plan = self.page._watch._plan
        self.harness.spin_until(lambda: not (via._remove.disabled or plan._save.disabled))
        self.harness.spin_until(lambda: plan._folder.visible)
        assert not self.heard

    def controls(self):
        """What every control of the page has, and where its handles are."""
        page_server = self.page._server
        values = {
            c._impl.uuid: c.value for c in page_server.gui._gui_input_handle_from_uuid.values()
        }
        handles = page_server.scene._handle_from_transform_controls_name
        return values | {name: tuple(handle.position) for name, handle in handles.items()}

    def _called(self, service, answer):
        self.heard.append((service, None))
        answer.success = True
        return answer

    def _set(self, changes):
        self.heard += [(change.name, change.value) for change in changes]
        return SetParametersResult(successful=True)


class Visit(Visited):
    """Browsers on the page of a graph, which goes on meanwhile."""

    def __init__(self, graph, monkeypatch):
        super().__init__(graph.port)
        self.graph, self.sent, self.judged = graph, 0, 0

        def judge(data, judged=server.read_message):
            self.judged += 1
            return judged(data)

        monkeypatch.setattr(server, "read_message", judge)

    def run(self, story, browsers=1):
        """Tell a story of browsers that have the page open, and close it in the end."""

        async def told():
            connections = [await self.open() for _ in range(browsers)]
            await story(*connections)
            for connection in connections:
                await connection.close()

        asyncio.run(told())

    async def until(self, condition, what=""):
        end = asyncio.get_running_loop().time() + DEADLINE_S
        while not condition():
            assert asyncio.get_running_loop().time() < end, what or self.graph.heard
            self.graph.harness.executor.spin_once(timeout_sec=0.002)
            await asyncio.sleep(0)

    async def open(self, **changed):
        connection = await self.connect(**changed)
        await self.say(connection)
        return connection

    async def say(self, connection, *messages):
        """Send, after where it looks from, and wait until all of it was judged."""
        await self.enter(connection)
        await send(connection, *messages)
        self.sent += 1 + len(messages)
        await self.until(lambda: self.judged >= self.sent, "judged")

    async def like(self, connection):
        """A good action of an operator is done, and nothing but that was."""
        heard = self.graph.heard
        await self.say(connection, update(self.graph.page._skills._thumbs, "Good"))
        await self.until(lambda: "intent/feedback" in dict(heard))
        ((_, message),) = heard
        assert (message.name, message.values[0].value) == (TASK, "up")
        heard.clear()


def grab(name, **changed):
    return {"type": browser_messages.GRAB, "name": name} | changed


def drag(name, place=(0.3, 0.2, 0.1), **changed):
    at = {"wxyz": [1.0, 0.0, 0.0, 0.0], "position": list(place)}
    return {"type": browser_messages.DRAG, "name": name} | at | changed


def leave(name, **changed):
    return {"type": browser_messages.LEAVE, "name": name} | changed
