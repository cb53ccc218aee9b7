# SPDX-License-Identifier: Apache-2.0
"""Models trained once for all system tests."""

from pathlib import Path

import pytest

from intent_recognition.demonstrations.dofs import load_dofs
from intent_recognition.demonstrations.reading import read_demonstrations
from intent_recognition.learning.training import TrainingSettings, learn
from intent_recognition.model.file import Model, save_model


@pytest.fixture(scope="session")
def toolbox_model(repository, tmp_path_factory) -> Path:
    """A model file learned from the shipped training bags."""
    dofs = load_dofs(repository / "config" / "dofs.yaml")
    demonstrations, rejections = read_demonstrations(repository / "bags/toolbox/train", dofs)
    assert not rejections and len(demonstrations) == 48
    library = learn(demonstrations, TrainingSettings())
    path = tmp_path_factory.mktemp("model") / "toolbox.npz"
    save_model(path, Model(library, dofs))
    return path
