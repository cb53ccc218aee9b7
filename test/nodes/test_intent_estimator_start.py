# SPDX-License-Identifier: Apache-2.0
"""What the estimator says when it cannot start: one line that names both sides, exit code 1."""

import json
import re

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


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ({"model": None}, "parameter model.*intent train"),
        ({"model": "/no.file"}, "/no.file"),
        ({"dofs": "/no.file"}, "/no.file"),
        *(({"publish_rate": rate}, "publish_rate") for rate in ("0.0", "-1.0", ".nan")),
    ],
)
def test_parameters_with_which_nothing_can_start(capfd, model, parameters, said):
    given = {"model": model, **parameters}
    given = {name: value for name, value in given.items() if value is not None}
    assert re.search(said, start(capfd, **given))


def test_why_it_cannot_start_is_logged_under_the_name_it_was_given(capfd):
    words = ("-r", "__node:=recognition", "-r", "__ns:=/cell1")
    assert main(["intent_estimator", "--ros-args", *words]) == 1
    (line,) = capfd.readouterr().err.splitlines()
    assert "[FATAL]" in line and "[cell1.recognition]" in line and "-p model:=" in line


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


def test_it_listens_to_what_ingest_makes_of_a_raw_pose():
    assert human_topic(WRIST) == "human/wrist"
    cell = DofEntry("cell/mocap/elbow/pose", WRIST.type, fields=WRIST.fields, unit="m")
    assert human_topic(cell) == "cell/human/elbow"
