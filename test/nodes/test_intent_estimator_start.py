# SPDX-License-Identifier: Apache-2.0
"""What the estimator says when it cannot start: one line that names both sides, exit code 1."""

import json

import numpy as np
import pytest
import yaml
from model_builder import GLOVE, WRIST, make_dofs, true_library

from intent_recognition.demonstrations.dofs import DofEntry, DofSpec
from intent_recognition.model.file import Model, save_model
from intent_recognition.nodes.intent_estimator import main
from intent_recognition.nodes.observation_input import human_topic

DOFS = make_dofs(WRIST, GLOVE)


@pytest.fixture
def model(tmp_path):
    path = tmp_path / "model.npz"
    save_model(path, Model(true_library(DOFS), DOFS))
    return path


def start(capfd, **parameters) -> str:
    """Start the node in this process; the one line it ends with."""
    words = [w for name, value in parameters.items() for w in ("-p", f"{name}:={value}")]
    assert main(["intent_estimator", "--ros-args", *words]) == 1
    lines = capfd.readouterr().err.splitlines()
    assert len(lines) == 1, lines
    return lines[0]


def test_without_a_model(capfd):
    line = start(capfd)
    assert "parameter model" in line and "intent train" in line


@pytest.mark.parametrize("name", ["model", "dofs"])
def test_a_file_that_is_not_there(capfd, model, name):
    assert "/no.file" in start(capfd, **{"model": model, name: "/no.file"})


OTHER = DofEntry("joint_states", "sensor_msgs/msg/JointState", joints=("a", "b"), unit="rad")


@pytest.mark.parametrize(
    ("dofs", "said"),
    [
        (make_dofs(WRIST), ("mine.yaml: observed", "thumb", "/mocap/wrist/pose")),
        (DofSpec(DOFS.observed, (OTHER,)), ("mine.yaml: controlled", "lwr_a1_joint", '["a", "b"]')),
    ],
)
def test_a_dof_file_of_other_dofs_names_both_sides(capfd, model, tmp_path, dofs, said):
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump(dofs.to_dict()))
    line = start(capfd, model=model, dofs=path)
    assert all(word in line for word in said)


def test_a_model_from_the_future_names_both_versions(capfd, model):
    with np.load(model, allow_pickle=False) as file:
        arrays = dict(file)
    header = json.loads(str(arrays["header"]))
    header["format_version"] = 17
    np.savez(model, **{**arrays, "header": np.array(json.dumps(header))})
    line = start(capfd, model=model)
    assert "format_version: expected 3, got 17" in line


def test_a_type_that_is_not_installed(capfd, tmp_path):
    alien = DofEntry("brain/waves", "alien_msgs/msg/Brain", fields=("alpha",), unit="V")
    dofs = make_dofs(alien)
    save_model(tmp_path / "m.npz", Model(true_library(dofs), dofs))
    assert "alien_msgs/msg/Brain" in start(capfd, model=tmp_path / "m.npz")


@pytest.mark.parametrize("rate", ["0.0", "-1.0", ".nan"])
def test_an_impossible_rate(capfd, model, rate):
    assert "publish_rate" in start(capfd, model=model, publish_rate=rate)


def test_it_listens_to_what_ingest_makes_of_a_raw_pose():
    assert human_topic(WRIST) == "human/wrist"
    cell = DofEntry("cell/mocap/elbow/pose", WRIST.type, fields=WRIST.fields, unit="m")
    assert human_topic(cell) == "cell/human/elbow"
