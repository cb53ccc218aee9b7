# SPDX-License-Identifier: Apache-2.0
"""The nodes of the package: their modules, purposes, topics and services.

This list feeds the executables (setup.py), the launch files, the policies of SROS 2 and the
reference. The file imports nothing from this package, so that setup.py can run it before anything
is installed.
"""

from collections.abc import Mapping
from typing import NamedTuple

BODY, HEARD, SAMPLED = "{body}", "{heard}", "{sampled}"
"""Placeholders: each tracked body; the estimator's topic of each DOF; and its source topic."""
RECORDED = (
    "mocap/wrist/pose",
    "joint_states",
    "intent/tasks",
    "intent/robot_trajectory",
    "intent/active_task",
    "intent/next_task",
    "intent/plan",
    "intent/transfer",
    "joint_trajectory",
    "coworker/hand",
    "coworker/task",
)
"""Topics of a cell that the launch files and the demo record."""
OWN_TOPICS = ("intent/", "human/", "joint_trajectory", "clock", "diagnostics", "rosout")
"""Topics that the nodes publish themselves, so that a recording must not be played on them."""
ANSWERS = "clock_answers"
"""Topic on which each node tells the simulated clock what it has processed."""
FRAMES = ("/tf", "/tf_static")
"""Topics with the frames of bodies and robots."""
ARMS = ("lwr_sim", "arm_sim")
"""Nodes of simulated arms, of which one is started."""
LEARNING = ("start", "stop", "learn", "discard", "keep", "undo")
"""Services of `task_teacher` that the page calls."""


class RegisteredNode(NamedTuple):
    """A node, and the relative names it uses beside those of every node; `~/` is the node's own.

    Names that it uses only with some parameters are among them.
    """

    module: str  # its `main` runs the node
    does: str  # a sentence for --help and the reference
    subscribes: tuple[str, ...] = ()
    publishes: tuple[str, ...] = ()
    offers: tuple[str, ...] = ()
    calls: tuple[str, ...] = ()
    managed: bool = False


_ARM = RegisteredNode(
    "sim_bridge.nodes.arm_sim",
    "A torque-controlled arm in PyBullet, 1 kHz physics: one of four, or any URDF.",
    subscribes=(
        ANSWERS,
        "intent/active_person",
        "intent/active_task",
        "intent/robot_trajectory",
        "intent/transfer",
        "joint_trajectory",
        "mocap/wrist/pose",
        "~/push",
    ),
    publishes=(
        "balls",
        "coworker/hand",
        "cup/cloud",
        "intent/feedback",
        "intent/holding",
        "joint_states",
        "robot_description",
        "second/cloud",
    ),
    offers=("~/gravity_compensation",),
)
NODES: Mapping[str, RegisteredNode] = {
    "mocap_ingest": RegisteredNode(
        "intent_recognition.nodes.mocap_ingest",
        "Checks raw tracker poses and turns them into world-frame odometry.",
        subscribes=(f"mocap/{BODY}/pose", *FRAMES),
        publishes=(f"human/{BODY}", *FRAMES),
    ),
    "intent_estimator": RegisteredNode(
        "intent_recognition.nodes.intent_estimator",
        "Recognises the human's task and predicts the movements of both agents.",
        subscribes=(HEARD, "intent/answer", "intent/sequence", "joint_states", "robot_description"),
        publishes=(
            "intent/human_path",
            "intent/human_trajectory",
            "intent/markers",
            "intent/next_task",
            "intent/plan",
            "intent/robot_trajectory",
            "intent/tasks",
            "intent/via_points",
            *FRAMES,
        ),
        offers=("~/reload_model", "~/reset", "~/save_plan"),
        managed=True,
    ),
    "primitive_activation": RegisteredNode(
        "intent_recognition.nodes.primitive_activation",
        "Decides when to act, and turns predictions into commands of the arm.",
        subscribes=(
            "intent/human_trajectory",
            "intent/next_task",
            "intent/robot_trajectory",
            "intent/tasks",
            "intent/transfer",
            "intent/via_points",
            f"human/{BODY}",
            "joint_states",
            "monitored_planning_scene",
            "robot_description",
        ),
        publishes=(
            "intent/active_person",
            "intent/active_task",
            "intent/correction",
            "intent/feedback",
            "intent/question",
            "intent/sequence",
            "joint_trajectory",
            "planning_scene",
        ),
        offers=("~/reset",),
        managed=True,
    ),
    "task_teacher": RegisteredNode(
        "intent_recognition.nodes.task_teacher",
        "Records a demonstration while the graph runs, learns it, and hands the model to the"
        " estimator.",
        subscribes=(
            SAMPLED,
            "joint_states",
            "robot_description",
            "intent/active_task",
            "intent/correction",
            "intent/feedback",
        ),
        publishes=("teach/skills", "teach/status"),
        offers=tuple(f"~/{name}" for name in (*LEARNING, "practise", "accept")),
        calls=("intent_estimator/reload_model", "intent_estimator/set_parameters"),
    ),
    "object_warper": RegisteredNode(
        "intent_recognition.nodes.object_warper",
        "Measures a seen container by warping an annotated one onto it.",
        subscribes=("object/cloud", "object/toward"),
        publishes=(
            "object/grasp",
            "object/labelled_cloud",
            "object/parameters",
            "object/pose",
            *FRAMES,
        ),
    ),
    "warped_primitive": RegisteredNode(
        "intent_recognition.nodes.warped_primitive",
        "Plans a pour for the seen containers from a learned pour.",
        subscribes=(
            "cup/parameters",
            "cup/pose",
            "joint_states",
            "pour",
            "second/parameters",
            "second/pose",
        ),
        publishes=("intent/robot_trajectory", "intent/tasks"),
    ),
    "object_transfer": RegisteredNode(
        "intent_recognition.nodes.object_transfer",
        "Estimates from forces at the hand who carries an object, and when to let it go.",
        subscribes=(
            f"human/{BODY}",
            "intent/active_person",
            "intent/active_task",
            "intent/holding",
            "joint_states",
            "joint_trajectory",
            "robot_description",
            "wrench",
        ),
        publishes=("intent/transfer",),
    ),
    "dashboard": RegisteredNode(
        "intent_recognition.dashboard.node",
        "Serves the web page.",
        subscribes=(
            "coworker/task",
            "intent/active_person",
            "intent/active_task",
            "intent/feedback",
            "intent/markers",
            "intent/robot_trajectory",
            "intent/tasks",
            "joint_states",
            f"mocap/{BODY}/pose",
            "robot_description",
            "intent/plan",
            "intent/question",
            "intent/transfer",
            "intent/via_points",
            "teach/skills",
            "teach/status",
            "wrench",
        ),
        publishes=("intent/answer", "intent/feedback", "joint_trajectory", f"mocap/{BODY}/pose"),
        calls=(
            "intent_estimator/reset",
            "intent_estimator/save_plan",
            "primitive_activation/reset",
            "intent_estimator/set_parameters",
            "primitive_activation/change_state",
            "primitive_activation/get_state",
            *(f"task_teacher/{name}" for name in LEARNING),
            *(f"{arm}/gravity_compensation" for arm in ARMS),
        ),
    ),
    "bag_recorder": RegisteredNode(
        "intent_recognition.nodes.bag_recorder",
        "Records topics of any type, byte for byte.",
        subscribes=RECORDED,
        offers=("~/start", "~/stop"),
    ),
    "bag_player": RegisteredNode(
        "intent_recognition.nodes.bag_player",
        "Replays a bag on its topics in the recorded rhythm.",
        publishes=(SAMPLED, *(topic for topic in RECORDED if not topic.startswith(OWN_TOPICS))),
        offers=("~/pause", "~/resume"),
    ),
    "arm_sim": _ARM,
    "lwr_sim": _ARM._replace(
        module="sim_bridge.nodes.lwr_sim",
        does="Runs arm_sim with the LWR 4+, without the parameters robot, tip and base_position.",
    ),
    "coworker_sim": RegisteredNode(
        "sim_bridge.nodes.coworker_sim",
        "A simulated worker whose wrist a simulated tracker follows.",
        publishes=("coworker/task", "mocap/wrist/pose"),
    ),
}
"""Nodes by the name of the executable, in the order of the reference."""
