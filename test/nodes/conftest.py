# SPDX-License-Identifier: Apache-2.0
"""A model that a teacher can go on from."""

import pytest
from model_builder import make_dofs, perform, true_library
from simulation import gathered

from intent_recognition.learning import TrainingSettings
from intent_recognition.model import Model, save_model


@pytest.fixture(scope="session")
def model(tmp_path_factory):
    """A file of two tasks, with statistics."""
    path, dofs = tmp_path_factory.mktemp("old") / "model.npz", make_dofs()
    shown = [perform(true_library(dofs), seed % 2, seed) for seed in range(8)]
    trained = gathered(shown, TrainingSettings(n_basis=10))
    save_model(path, Model(trained.library, dofs), trained)
    return path
