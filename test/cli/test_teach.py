# SPDX-License-Identifier: Apache-2.0
"""`intent teach` and `intent undo` as their user runs them, beside publishers of a cell."""

import subprocess
import sys
import threading

import numpy as np
import pytest
import yaml
from geometry_msgs.msg import PoseStamped
from model_builder import make_dofs, perform, true_library, write_recording
from rclpy.duration import Duration
from rclpy.executors import SingleThreadedExecutor
from sensor_msgs.msg import JointState

from intent_recognition.cli import teach
from intent_recognition.demonstrations import DofEntry, DofSpec
from intent_recognition.errors import BagError, DofError, ModelError, ResourceBusyError
from intent_recognition.learning import RuleChange
from intent_recognition.model import TaskFolder, load_model, save_model
from intent_recognition.nodes import qos, runtime
from intent_recognition.nodes.conversions import to_joint_state, to_pose, to_stamp
from intent_recognition.nodes.intent_estimator import IntentEstimatorNode
from intent_recognition.signals.observation import merge

DOFS = make_dofs()
TRUTH = true_library(DOFS)
OLD, NEW = TRUTH.labels[0], TRUTH.labels[2]
ELBOW = DofEntry("elbow", DOFS.observed[0].type, fields=("pose.position.x",))
UPRIGHT = (0.0, 0.0, 0.0, 1.0)
LONGEST_S = 300.0
"""After so long a command is ended and what it printed is shown [s]."""


@pytest.fixture(scope="module")
def old(tmp_path_factory):
    """A model of one task, with statistics."""
    folder = TaskFolder(tmp_path_factory.mktemp("old") / "tasks", DOFS)
    for seed in range(4):
        folder.learn(write_recording(folder.new_bag(OLD), perform(TRUTH, 0, seed), DOFS))
    return folder.model_path


class Command:
    """`intent ...` as a process whose lines can be waited for."""

    def __init__(self, *arguments):
        self.process = subprocess.Popen(
            [sys.executable, "-u", "-m", "intent_recognition.cli.main", *map(str, arguments)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self._end = threading.Timer(LONGEST_S, self.process.kill)

    def __enter__(self):
        self._end.start()
        return self

    def __exit__(self, *_):
        self._end.cancel()
        self.process.kill()
        self.process.communicate()

    def wait_for(self, text):
        seen = []
        for line in self.process.stdout:
            seen.append(line)
            if text in line:
                return line
        raise AssertionError(f"no {text!r} in {''.join(seen)}")

    def press(self, key=""):
        self.process.stdin.write(f"{key}\n")
        self.process.stdin.flush()


@pytest.mark.slow
def test_teach_records_learns_and_undo_takes_it_back(harness, tmp_path, old):
    # Each message is kept until it has arrived, however late the command is on a busy machine.
    kept = qos.keep_last(qos.PLAYBACK_DEPTH)
    pose = harness.publisher(PoseStamped, "mocap/wrist/pose", kept)
    joints = harness.publisher(JointState, "joint_states", kept)
    library = tmp_path / "tasks"
    with Command("teach", NEW, "--library", library, "--model", old) as command:
        command.wait_for("Enter: record")
        harness.connect(pose, joints)
        command.press()
        command.wait_for("recording; Enter")
        recording = perform(TRUTH, 2, 50)
        for observation in merge((*recording.observed, *recording.controlled)):
            send(pose, joints, observation)
        assert joints.wait_for_all_acked(Duration(seconds=30))
        assert pose.wait_for_all_acked(Duration(seconds=30))
        command.press()
        assert f"{NEW} 1" in command.wait_for("learned")
        command.press("q")
        assert command.process.wait(30) == 0
    folder = TaskFolder(library, DOFS)
    assert dict(folder.history()[-1].tasks) == {OLD: 4, NEW: 1}
    with Command("undo", "--library", library) as command:
        assert f"{OLD} 4" in command.wait_for("took")
        assert command.process.wait(30) == 0
    assert dict(folder.history()[-1].tasks) == {OLD: 4}


def send(pose, joints, observation):
    stamp = int(observation.stamp_ns)
    if observation.group == 0:
        message = PoseStamped(pose=to_pose(observation.values, UPRIGHT))
        message.header.stamp, message.header.frame_id = to_stamp(stamp), "world"
        pose.publish(message)
    else:
        joints.publish(to_joint_state(DOFS.controlled_names, observation.values, time_ns=stamp))


@pytest.mark.slow
@pytest.mark.parametrize("own", [True, False])
def test_practice_is_given_to_an_estimator_of_its_library_alone(harness, tmp_path, old, own):
    folder = TaskFolder(tmp_path / "tasks", DOFS)
    folder.start_from(old)
    size = load_model(folder.model_path).library.regressions[0].matrix.shape
    change = RuleChange(np.zeros(size), np.full(size[0], 0.01))
    practice = folder.path / "practice" / OLD / "practice_00"
    folder.improve(OLD, practice, change, folder.present_model())
    other = TaskFolder(tmp_path / "others", DOFS)
    for seed in (7, 8):
        other.learn(write_recording(other.new_bag(OLD), perform(TRUTH, 0, seed), DOFS))
    runs = folder.model_path if own else other.model_path
    estimator = harness.node(IntentEstimatorNode, model=str(runs))
    model = estimator._model
    with Command("improve", OLD, "--library", folder.path, "--undo") as command:
        harness.spin_until(lambda: command.process.poll() is not None)
        told = " ".join(command.process.stdout.read().split())
    assert command.process.returncode == 0
    assert folder.history()[-1].action == "undo"
    assert (estimator._model is not model) == own
    wanted = "in use by intent_estimator" if own else f"not in use: the estimator runs {runs}"
    assert wanted in told


@pytest.mark.parametrize("came", ["none", "another folder"])
def test_undo_of_no_library_makes_none(tmp_path, run_command, came):
    library = tmp_path / "misspelt"
    if came != "none":
        library.mkdir()
    with pytest.raises(ModelError, match=f"misspelt: expected a folder of tasks, got {came}"):
        run_command("undo", "--library", library)
    assert list(tmp_path.rglob("*")) == [library] * (came != "none")


@pytest.fixture
def soon(monkeypatch):
    """Topics are waited for no longer than a moment."""
    monkeypatch.setattr(teach, "DISCOVERY_S", 0.1)
    monkeypatch.setattr(runtime, "make_executor", SingleThreadedExecutor)  # stderr is no file


@pytest.mark.usefixtures("soon")
def test_what_is_refused_for_its_topics_makes_no_library(tmp_path, run_command, old):
    library = tmp_path / "tasks"
    with pytest.raises(BagError, match=r"publishers of /joint_states, /mocap/wrist/pose"):
        run_command("teach", NEW, "--library", library, "--model", old)
    assert not library.exists()


@pytest.mark.usefixtures("soon")
def test_a_library_goes_on_with_its_own_model_and_dofs(tmp_path, run_command, old):
    library = tmp_path / "tasks"
    TaskFolder(library, DOFS).start_from(old)
    before = sorted(library.rglob("*"))
    other = tmp_path / "other.npz"
    save_model(other, load_model(old))
    with pytest.raises(ResourceBusyError, match=r"--model: expected the model that .*tasks began"):
        run_command("teach", NEW, "--library", library, "--model", other)
    dofs = tmp_path / "dofs.yaml"
    dofs.write_text(yaml.safe_dump(DofSpec((ELBOW,), DOFS.controlled).to_dict()))
    with pytest.raises(DofError, match="observed"):
        run_command("teach", NEW, "--library", library, "--dofs", dofs)
    with pytest.raises(BagError, match="publishers"):  # the one it began with: as far as the topics
        run_command("teach", NEW, "--library", library, "--model", old)
    assert sorted(library.rglob("*")) == before
