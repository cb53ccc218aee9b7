# SPDX-License-Identifier: Apache-2.0
"""Orientations from recording to prediction: signs, a turned world, small angles, the spread."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from bag_builder import START_NS, STEP_NS
from model_builder import ROBOT, message_of
from scipy.spatial.transform import Rotation
from simulation import gathered

from intent_recognition.bags import POSE, BagReader, BagWriter
from intent_recognition.bags.definitions import make_message
from intent_recognition.demonstrations import DofSpec, read_demonstrations, settle_orientations
from intent_recognition.demonstrations.entry import DofEntry
from intent_recognition.demonstrations.fields import extract, numbers_of, orientation_beside
from intent_recognition.demonstrations.observations import ObservationReader, iter_observations
from intent_recognition.errors import DofError, MessageError
from intent_recognition.learning import TrainingSettings, fit_interaction_promp
from intent_recognition.model import Model, check_dofs, load_model, save_model
from intent_recognition.recognition import IntentEstimator
from intent_recognition.signals import POSE_FIELDS, merge

QUATERNION = tuple(f"pose.orientation.{axis}" for axis in "xyzw")
HAND = DofEntry("tracker/hand", POSE, QUATERNION, unit="rad", orientation="quaternion")
CUP = replace(HAND, topic="tracker/cup")
DOFS = DofSpec((HAND,), (CUP,))
SETTINGS = TrainingSettings(n_basis=8, n_aligned_basis=8)
N_SAMPLES = 90


def paths(seed, scale=1.0):
    """Rotation vectors (T, 3) of hand and cup: two tasks, each demonstration another."""
    rng = np.random.default_rng(seed)
    z = np.clip(np.linspace(-0.3, 1.3, N_SAMPLES), 0.0, 1.0)[:, None]
    reach = z**3 * (10.0 - 15.0 * z + 6.0 * z**2)
    turn = (np.array([1.4, 0.3, 0.0]) if seed % 2 else np.array([-0.2, 1.2, 0.5])) * scale
    start, goal = 0.15 * scale * rng.normal(size=(2, 3))
    hand = start + reach * (turn + goal)
    cup = 0.5 * start + reach * (turn[::-1] + 0.8 * goal)
    noise = 1e-3 * scale * rng.normal(size=(2, N_SAMPLES, 3))
    return hand + noise[0], cup + noise[1]


def write(folder, world, signs=None, scale=1.0, n=12):
    """Demonstrations in a world that is turned, with signs of quaternions as they come."""
    for seed in range(n):
        custom = {"task": ("left", "right")[seed % 2]}
        with BagWriter(folder / f"demo_{seed:02d}", custom) as writer:
            rows = zip(*paths(seed, scale), strict=True)
            for k, vectors in enumerate(rows):
                for entry, vector in zip((HAND, CUP), vectors, strict=True):
                    quaternion = (world * Rotation.from_rotvec(vector)).as_quat()
                    sign = 1.0 if signs is None else signs.choice([-1.0, 1.0])
                    stamp_ns = START_NS + 2 * k * STEP_NS
                    fields = message_of(entry, stamp_ns, sign * quaternion)
                    writer.write_message(entry.topic, POSE, fields, stamp_ns)
    return folder


def read(folder):
    dofs = settle_orientations(DOFS, folder)
    demonstrations, rejections = read_demonstrations(folder, dofs)
    assert not rejections
    return dofs, demonstrations


def predicted(dofs, demonstrations):
    """Tasks, and the cup's predicted quaternions and spread, half-way through the last one."""
    library = gathered(demonstrations[:-1], SETTINGS).library
    estimator = IntentEstimator(library)
    seen = list(merge(demonstrations[-1].observed))
    for observation in seen[: len(seen) * 6 // 10]:
        estimate = estimator.update(observation)
    trajectory = estimator.predict_controlled().trajectory
    return library, estimate.probabilities, numbers_of(dofs.controlled, trajectory)


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    """The demonstrations as they are, and what is predicted from them."""
    dofs, demonstrations = read(write(tmp_path_factory.mktemp("world"), Rotation.identity()))
    return dofs, demonstrations, predicted(dofs, demonstrations)


@pytest.mark.slow
def test_q_and_minus_q_are_the_same_demonstrations_bit_for_bit(world, tmp_path):
    dofs, demonstrations, _ = world
    rng = np.random.default_rng(1)
    others, flipped = read(write(tmp_path, Rotation.identity(), signs=rng))
    assert others == dofs
    for ours, theirs in zip(demonstrations, flipped, strict=True):
        for a, b in zip((*ours.observed, *ours.controlled), (*theirs.observed, *theirs.controlled)):
            np.testing.assert_array_equal(a.values, b.values)
            assert a.names == ("tracker/" + a.names[0][8:11] + a.names[0][11:], *a.names[1:])


@pytest.mark.slow
def test_a_turned_world_gives_the_turned_prediction(world, tmp_path):
    _, _, (_, probabilities, trajectory) = world
    turn = Rotation.from_rotvec([2.0, -1.0, 0.7])
    dofs, demonstrations = read(write(tmp_path, turn))
    _, others, turned = predicted(dofs, demonstrations)
    np.testing.assert_allclose(others, probabilities, atol=1e-8)
    expected = turn * Rotation.from_quat(trajectory.positions)
    found = Rotation.from_quat(turned.positions)
    np.testing.assert_allclose((found.inv() * expected).magnitude(), 0.0, atol=1e-8)
    np.testing.assert_allclose(turned.std, trajectory.std, atol=1e-8)


def test_what_is_predicted_is_near_what_was_done_within_its_spread(world):
    _, _, (_, probabilities, trajectory) = world
    assert np.argmax(probabilities) == 1  # right
    np.testing.assert_allclose(np.linalg.norm(trajectory.positions, axis=1), 1.0, atol=1e-12)
    assert np.all(np.sum(trajectory.positions[1:] * trajectory.positions[:-1], axis=1) > 0.9)
    end = Rotation.from_rotvec(paths(11)[1][-1])
    error = (Rotation.from_quat(trajectory.positions[-1]).inv() * end).as_rotvec()
    assert np.all(np.abs(error) < 4.0 * trajectory.std[-1, :3])
    assert np.all(trajectory.std[-1, :3] < 0.3) and not trajectory.std[:, 3].any()
    steps = np.diff(trajectory.times_s)[:, None]
    mean_rates = 0.5 * (trajectory.velocities[1:] + trajectory.velocities[:-1])
    np.testing.assert_allclose(np.diff(trajectory.positions, axis=0) / steps, mean_rates, atol=0.05)


def test_the_limit_of_small_angles_is_euclidean(tmp_path):
    scale = 1e-3
    turn = Rotation.from_rotvec([0.3, 0.2, 0.1])
    _, demonstrations = read(write(tmp_path, turn, scale=scale))
    for seed, recorded in enumerate(demonstrations):
        for signal, vectors in zip(
            (*recorded.observed, *recorded.controlled), paths(seed, scale), strict=True
        ):
            moved = signal.values - signal.values[0]
            np.testing.assert_allclose(moved, vectors - vectors[0], atol=10.0 * scale**2)
    flat = [
        replace(
            recorded,
            observed=(replace(recorded.observed[0], values=paths(seed, scale)[0]),),
            controlled=(replace(recorded.controlled[0], values=paths(seed, scale)[1]),),
        )
        for seed, recorded in enumerate(demonstrations)
    ]
    ours, theirs = (
        fit_interaction_promp(d[1::2]).weights.covariance for d in (demonstrations, flat)
    )
    np.testing.assert_allclose(ours, theirs, atol=20.0 * scale * np.abs(theirs).max())


def test_a_model_keeps_the_reference_and_takes_dof_files_without_one(world, tmp_path):
    dofs, _, (library, _, _) = world
    save_model(tmp_path / "m.npz", Model(library, dofs))
    model = load_model(tmp_path / "m.npz")
    assert model.dofs == dofs and check_dofs(model, DOFS, "mine.yaml") == dofs
    other = replace(HAND, reference=(1.0, 0.0, 0.0, 0.0))
    with pytest.raises(DofError, match=r"mine.yaml: observed"):
        check_dofs(model, DofSpec((other,), (CUP,)), "mine.yaml")
    with pytest.raises(DofError, match="settle_orientations"):
        save_model(tmp_path / "n.npz", Model(library, DOFS))
    with pytest.raises(DofError, match="settle_orientations"):
        read_demonstrations(tmp_path, DOFS)
    assert dofs.controlled_message_names == tuple(f"tracker/cup.{f}" for f in QUATERNION)
    assert DofSpec.from_dict(dofs.to_dict()) == dofs


def test_orientations_are_found_beside_positions_or_named_where_none_is(tmp_path):
    with BagWriter(tmp_path / "bag") as writer:
        writer.write_message(HAND.topic, POSE, message_of(HAND, START_NS, np.zeros(4)), START_NS)
    with pytest.raises(DofError, match=r"tracker/hand.pose.orientation.rx: .*none in 1 of"):
        settle_orientations(DofSpec((HAND,), ()), tmp_path)
    position = replace(WRIST, fields=POSE_FIELDS[:3], orientation="", reference=(), unit="m")
    assert orientation_beside((HAND, position, WRIST), 1) == 2
    assert orientation_beside((HAND, position), 1) is None
    assert orientation_beside((HAND, position), 0) is None


WRIST = replace(HAND, topic="mocap/wrist/pose", reference=(0.0, 0.0, 0.6, 0.8))


def test_noise_about_the_world_s_axes_is_noise_of_the_rotation_vector():
    entry = DofEntry(
        "hand",
        "nav_msgs/msg/Odometry",
        tuple(f"pose.{field}" for field in QUATERNION),
        unit="rad",
        orientation="quaternion",
        reference=WRIST.reference,
    )
    matrix = np.diag([9.0, 9.0, 9.0, 1e-4, 4e-4, 9e-4])
    pose = {"pose": {"orientation": {"z": 0.6, "w": 0.8}}, "covariance": matrix.ravel().tolist()}
    observation = ObservationReader(entry, 0).observe(1, make_message(entry.type, {"pose": pose}))
    assert observation.values.tolist() == [0.0, 0.0, 0.0]
    turn = Rotation.from_quat(WRIST.reference).as_matrix()
    expected = turn.T @ matrix[3:, 3:] @ turn
    np.testing.assert_allclose(observation.covariance, expected, atol=1e-15)


def test_an_orientation_that_a_raw_pose_does_not_have_is_missing(tmp_path):
    position = replace(WRIST, fields=POSE_FIELDS[:3], orientation="", reference=(), unit="m")
    dofs = DofSpec((position, WRIST), (ROBOT,))
    with BagWriter(tmp_path / "bag", {"task": "give"}) as writer:
        for k in range(60):
            at_ns = START_NS + k * STEP_NS
            turned = [0.0, 0.0, 0.6, 0.8] if k % 3 else [0.0] * 4
            whole = replace(WRIST, fields=POSE_FIELDS)
            fields = message_of(whole, at_ns, [0.001 * k, 0, 0, *turned])
            writer.write_message(WRIST.topic, POSE, fields, at_ns)
            arm = message_of(ROBOT, at_ns, [0.0] * 7)
            writer.write_message(ROBOT.topic, ROBOT.type, arm, at_ns)
    (found,), _ = read_demonstrations(tmp_path / "bag", dofs)
    assert [len(signal.stamps_ns) for signal in found.observed] == [60, 40]
    np.testing.assert_allclose(found.observed[1].values, 0.0, atol=1e-15)
    rejected = Counter()
    samples = iter_observations(BagReader(tmp_path / "bag"), dofs, rejected=rejected)
    seen = list(samples)
    turns = [o for o in seen if o.group == 1]
    assert len(seen) == 100 and len(turns) == 40 and rejected == {"missing_dof": 20}
    np.testing.assert_allclose(turns[0].covariance, 0.02**2 * np.eye(3), atol=1e-15)
    with pytest.raises(MessageError, match="within 171 degrees"):
        extract_far(WRIST)


def extract_far(entry):
    far = make_message(POSE, {"pose": {"orientation": {"z": 0.8, "w": -0.6}}})
    assert np.isnan(extract(entry, far)).all()
    return ObservationReader(entry, 0).observe(1, far)
