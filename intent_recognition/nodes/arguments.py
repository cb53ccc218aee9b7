# SPDX-License-Identifier: Apache-2.0
"""The launch arguments, each described once for the launch files, the demo and the docs."""

from collections.abc import Callable
from dataclasses import dataclass

from intent_recognition.errors import ArgumentError


@dataclass(frozen=True)
class Argument:
    """A launch argument of a graph, which cannot start without its `needed` ones.

    The kind tuple stands for texts, and list for numbers, separated by commas.
    """

    name: str
    kind: type
    description: str
    needed: bool = False

    def read(self, value: object) -> object:
        """Convert text to a value of this kind; None for an empty text or list."""
        if not isinstance(value, str) or self.kind is str:
            return None if value == "" else value
        text = value.strip()
        try:
            read = _KINDS[self.kind][0](text) if text else None
        except (ValueError, KeyError) as error:
            _, kind, example = _KINDS[self.kind]
            cure = f"Give {self.name}:={example}."
            raise ArgumentError.about(self.name, kind, repr(text), cure) from error
        return None if read in ((), []) else read


_KINDS: dict[type, tuple[Callable[[str], object], str, str]] = {
    list: (lambda text: [float(word) for word in text.split(",")], "numbers", "1.0,2.0"),
    bool: (lambda text: {"true": True, "false": False}[text.lower()], "true or false", "true"),
    int: (int, "a whole number", "1"),
    float: (float, "a number", "1.0"),
    tuple: (lambda text: tuple(filter(None, map(str.strip, text.split(",")))), "texts", "a,b"),
}
"""For each kind: the function that reads a text, the expected form in words, and an example."""

ARGUMENTS = {
    argument.name: argument
    for argument in (
        Argument("model", str, "Model file written by `intent train`.", needed=True),
        Argument("bag", str, "Recording to replay.", needed=True),
        Argument("dofs", str, "DOF file to check the model against; empty: the model's own."),
        Argument(
            "params_file",
            str,
            "Parameter file that overrides the graph's own; other arguments override both.",
        ),
        Argument("namespace", str, "Namespace of the nodes."),
        Argument("respawn", bool, "Restart nodes that die; default true."),
        Argument("use_sim_time", bool, "Take the time from /clock."),
        Argument("bodies", tuple, "Tracked bodies, separated by commas."),
        Argument("command_topic", str, "Topic on which the arm takes a JointTrajectory."),
        Argument(
            "command_action", str, "Action FollowJointTrajectory that takes commands as goals."
        ),
        Argument("joint_states_topic", str, "Topic of the arm's joint states."),
        Argument("activate", bool, "Activate at start; if false: `ros2 lifecycle set`."),
        Argument("transition_prior", bool, "Expect the task that usually follows the last one."),
        Argument(
            "pretrigger_threshold",
            float,
            "Probability of the next task from which the arm starts early; 0: never.",
        ),
        Argument("transfers", bool, "Hand objects over by force: start object_transfer."),
        Argument("plan", str, "Plan of the assembly, a file of `intent plan learn`; empty: none."),
        Argument("sequences", str, "File of sequences of tasks; empty: none."),
        Argument("arm", str, "Simulated arm: panda, iiwa, xarm or a URDF; empty: the LWR."),
        Argument("hand_link", str, "Link that is the hand, for a model that predicts a hand."),
        Argument("scenario", str, "What the coworker works at: toolbox or assembly."),
        Argument("publish_clock", bool, "The arm publishes /clock."),
        Argument("rate", float, "Speed of simulation or playback; 1 is real time."),
        Argument("headless", bool, "No PyBullet window."),
        Argument("sensor_noise", bool, "Noise on the simulated arm's joint states."),
        Argument("coworker", bool, "Start the simulated coworker."),
        Argument("task_list", str, "Tasks of the coworker: labels, a file, random or habit."),
        Argument("seed", int, "Seed of the coworker's movements and of the noise."),
        Argument("loop", bool, "Repeat the recording."),
        Argument("start_paused", bool, "Wait for bag_player/resume."),
        Argument("record", str, "Folder of a new bag with the session; empty: none."),
        Argument("dashboard", bool, "Serve the web page, and teach tasks from it."),
        Argument("port", int, "Port of the web page."),
        Argument("scene", str, "Objects in the cell, drawn on the page: a YAML file, or toolbox."),
        Argument("light", str, "Page without shadows: always, never, or auto (in slow browsers)."),
        Argument("arm_scene", str, "World of the simulated arm: transfers, pouring or none."),
        Argument("cup", str, "Container in the hand, in the scene pouring."),
        Argument("second", str, "Container that is poured into, in the scene pouring."),
        Argument("second_opening", list, "Centre of the second's opening: x, y, z [m]."),
        Argument(
            "skill", str, "Pouring skill, a file of `save_pouring_skill`; empty: the shipped one."
        ),
        Argument("fluid", float, "Initial contents of the cup, as a share of its volume."),
        Argument("stands_above", float, "Height of the contents above the lip [m]."),
        Argument("library", str, "Folder of the tasks taught from the page."),
        Argument("models", str, "Folder of the models the page compares."),
        Argument("rviz", bool, "Open RViz with config/intent.rviz."),
    )
}
