# SPDX-License-Identifier: Apache-2.0
"""The pointing experiment on a subset."""

import json

import numpy as np
import pytest

from experiments.pointing.experiment import QUICK_SPOTS, run
from experiments.pointing.study import condition_on_end, metadata_values, predicted_spot
from experiments.settings import Settings
from intent_recognition.demonstrations import read_demonstrations
from intent_recognition.demonstrations.dofs import load_dofs
from intent_recognition.gaussian.normal import Gaussian, marginal, regression
from intent_recognition.learning.training import learn


@pytest.fixture(scope="module")
def outcome(shipped_again):
    return run(Settings(quick=True))


@pytest.mark.slow
def test_the_arm_points_within_the_circle_tenth(outcome):
    numbers = outcome.numbers
    assert len(numbers["error_m"]) == 2
    assert numbers["largest_error_m"] == max(numbers["error_m"]) < 0.03
    assert numbers["mean_error_m"] < np.mean(numbers["nearest_demonstration_error_m"])
    assert not any(numbers["touched_table"])
    json.dumps(dict(numbers))


@pytest.mark.slow
def test_the_arm_does_what_was_predicted(outcome):
    assert outcome.numbers["largest_execution_error_m"] < 0.002


@pytest.mark.slow
def test_other_seeds_stand_beside_the_shipped_draw(outcome, repository):
    """Were some of the shipped recordings drawn again, what they teach would come out."""
    folder = repository / "bags" / "pointing"
    train, test = (
        read_demonstrations([folder / purpose / name for name in QUICK_SPOTS], load_dofs())[0]
        for purpose in ("train", "test")
    )
    library = learn(train)
    off = [predicted_spot(library, one) - metadata_values(one, "spot_m")[:2] for one in test]
    (draw,) = outcome.numbers["draws"]
    assert draw["seed"] == 2
    assert draw["largest_m"] == pytest.approx(np.linalg.norm(off, axis=1).max())
    assert draw["mean_m"] == pytest.approx(np.linalg.norm(off, axis=1).mean())
    both = sorted([100 * draw["largest_m"], 100 * outcome.numbers["largest_error_m"]])
    assert outcome.findings[0].ours == f"{np.mean(both):.1f} ({both[0]:.1f} to {both[1]:.1f})"


@pytest.mark.slow
def test_conditioning_on_the_end_is_the_joint_gaussian_of_end_and_weights(repository):
    bags = sorted((repository / "bags" / "pointing" / "train").iterdir())[:4]
    library = learn(read_demonstrations(bags, load_dofs())[0])
    primitive, n_basis = library.primitive(0).weights, library.basis.n_basis
    wrist = np.array([0.9, 0.02, 0.03])
    row = library.basis.design_matrix(np.ones(1))[0]
    matrix = np.zeros((3, len(primitive.mean)))
    for k in range(3):
        matrix[k, k * n_basis : (k + 1) * n_basis] = row
    noise = np.diag(library.noise_variance[:3] * library.noise_scale)
    cross = matrix @ primitive.covariance
    joint = Gaussian(
        np.concatenate((matrix @ primitive.mean, primitive.mean)),
        np.block([[cross @ matrix.T + noise, cross], [cross.T, primitive.covariance]]),
    )
    rule = regression(joint, 3)
    posterior = condition_on_end(library, wrist)
    np.testing.assert_allclose(posterior.mean, rule.matrix @ wrist + rule.offset, atol=1e-8)
    np.testing.assert_allclose(posterior.covariance, rule.covariance, atol=1e-9)
    spread = np.diag(marginal(primitive, np.arange(5)).covariance)
    assert np.all(np.diag(posterior.covariance)[:5] <= spread + 1e-12)
