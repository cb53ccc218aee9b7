# SPDX-License-Identifier: Apache-2.0
"""Context entries from the DOF file and bags to the model file and `intent replay`."""

from dataclasses import replace

import numpy as np
import pytest
import yaml
from bag_builder import JOINTS, TEXT
from model_builder import message_of, messages_of, write_recording
from moved_box import BOX, DOFS, SETTINGS, hand_over, learned
from simulation import START_NS

from intent_recognition.bags import BagReader, BagWriter
from intent_recognition.demonstrations import DofEntry, load_dofs, read_demonstrations
from intent_recognition.demonstrations.observations import Source, iter_observations, iter_samples
from intent_recognition.errors import DofError, ModelError
from intent_recognition.evaluation import evaluate, make_folds, replay, run_online
from intent_recognition.learning import add_demonstration
from intent_recognition.model import Model, check_dofs, load_model, load_trained, save_model
from intent_recognition.recognition import IntentEstimator
from intent_recognition.share import share_path
from intent_recognition.signals import merge

CUP = DofEntry("object/parameters", JOINTS, joints=("radius", "height"), unit="m", context=True)
PLACE = (0.2, -0.1)


def test_the_dof_file_has_it_among_the_observed(tmp_path):
    dofs = replace(DOFS, context=(BOX, CUP))
    path = tmp_path / "dofs.yaml"
    path.write_text(yaml.safe_dump(dofs.to_dict()))
    assert load_dofs(path) == dofs
    assert dofs.context_names == (*BOX.names, "radius", "height")
    assert set(dofs.topics) == {"mocap/wrist/pose", "joint_states", "box/pose", "object/parameters"}
    assert load_dofs(share_path("config/examples/moved_box.dofs.yaml")).context == (BOX,)
    content = yaml.safe_load(path.read_text())
    assert [entry.get("context", False) for entry in content["observed"]] == [False, True, True]


@pytest.mark.slow
def test_a_bag_holds_it_once_and_a_model_file_keeps_what_was_learned(tmp_path):
    recorded = hand_over("give", 100, box=PLACE)
    bag = write_recording(tmp_path / "bag", recorded, DOFS)
    (found,), rejections = read_demonstrations(bag, DOFS)
    assert not rejections
    np.testing.assert_array_equal(found.context_values, PLACE)
    assert found.context[0].names == BOX.names

    model = Model(learned().library, DOFS)
    save_model(tmp_path / "model.npz", model, learned())
    loaded, trained = load_trained(tmp_path / "model.npz")
    given, expected = (m.library.given(PLACE) for m in (loaded, model))
    for name in ("weight_mean", "weight_covariance", "observed_weight_covariance"):
        np.testing.assert_array_equal(getattr(given, name), getattr(expected, name))
    more = add_demonstration(trained, found).library.context
    np.testing.assert_allclose(
        more.gain, add_demonstration(learned(), found).library.context.gain, atol=1e-12
    )
    check_dofs(loaded, DOFS, "mine.yaml")
    with pytest.raises(DofError, match=r"mine\.yaml: observed"):
        check_dofs(loaded, replace(DOFS, context=()), "mine.yaml")

    rows = list(replay(BagReader(bag), loaded))
    estimator = IntentEstimator(expected)
    estimates = [estimator.update(o) for o in iter_observations(BagReader(bag), DOFS)]
    for row, estimate in zip(rows, estimates, strict=True):
        found = list(row["probabilities"].values())
        np.testing.assert_allclose(found, estimate.probabilities, atol=1e-9)


@pytest.mark.slow
def test_a_model_file_whose_context_is_missing_or_none_is_refused(tmp_path):
    path = tmp_path / "model.npz"
    save_model(path, Model(learned().library, DOFS))
    content = dict(np.load(path))
    for name, value, message in (
        ("context_gain", None, "context_gain: expected an array"),
        ("context_mean", np.zeros((2, 3)), "context_mean: expected shape"),
        ("context_covariance", np.zeros((2, 2, 2)), "context_covariance: expected above zero"),
    ):
        changed = {k: v for k, v in content.items() if k != name}
        np.savez(path, **(changed if value is None else changed | {name: value}))
        with pytest.raises(ModelError, match=message):
            load_model(path)


def test_a_context_of_a_session_holds_until_another_comes(tmp_path):
    """Said once before the first of three, and again between the second and the third."""
    places, parts = [PLACE, PLACE, (-0.1, 0.1)], []
    with BagWriter(tmp_path / "session") as writer:
        for k, place in enumerate(places):
            recorded = hand_over("give", k, box=place)
            begin_ns = START_NS + k * 10 * 10**9
            if k != 1:
                said_ns = begin_ns - 5 * 10**9
                writer.write_message(BOX.topic, BOX.type, message_of(BOX, said_ns, place), said_ns)
            writer.write_message("demonstration", TEXT, {"data": "give"}, begin_ns)
            for entry, stamp_ns, values in messages_of(replace(recorded, context=()), DOFS):
                at_ns = stamp_ns - START_NS + begin_ns + 10**6
                fields = message_of(entry, at_ns, values)
                writer.write_message(entry.topic, entry.type, fields, at_ns)
            end_ns = recorded.end_ns - START_NS + begin_ns + 2 * 10**6
            writer.write_message("demonstration", TEXT, {"data": ""}, end_ns)
            parts.append(recorded)
    found, rejections = read_demonstrations(tmp_path / "session", DOFS)
    assert not rejections
    np.testing.assert_array_equal([one.context_values for one in found], places)


def test_a_recording_without_its_context_is_left_out_and_says_so(tmp_path):
    recorded = hand_over("give", 100)
    bag = write_recording(tmp_path / "none", replace(recorded, context=()), DOFS)
    (found,) = read_demonstrations(bag, DOFS)[1]
    assert found.topic == "/box/pose" and "missing topic" in found.reason
    (signal,) = recorded.context
    after = replace(signal, stamps_ns=np.array([recorded.end_ns + 10**9]))
    bag = write_recording(tmp_path / "late", replace(recorded, context=(after,)), DOFS)
    (found,) = read_demonstrations(bag, DOFS)[1]
    assert found.topic == "/box/pose" and "nothing of the context" in found.reason


def test_samples_of_a_bag_say_what_they_are_of(tmp_path):
    bag = write_recording(tmp_path / "bag", hand_over("give", 100), DOFS)
    sources = [source for source, _ in iter_samples(BagReader(bag), DOFS)]
    assert sources.count(Source.CONTEXT) == 1 and sources.index(Source.CONTEXT) < 3
    assert sources.count(Source.OBSERVED) == sources.count(Source.CONTROLLED) > 100


@pytest.mark.slow
def test_evaluation_knows_the_context():
    recorded = [hand_over(task, k) for k in range(6) for task in ("give", "take")]
    ends = []
    for demonstrations in (recorded, [replace(one, context=()) for one in recorded]):
        folds = make_folds(demonstrations, "kfold:3")[:1]
        found = evaluate(demonstrations, folds, SETTINGS, unknown_tasks=False)
        ends.append(found["prediction"]["unknown_phase"]["0.25"]["end_rmse"])
    assert ends[0] < 0.4 * ends[1]


def test_the_online_run_is_told_the_context_by_stamp():
    library, recorded = learned().library, hand_over("give", 120, box=PLACE)
    told = run_online(library, recorded)
    known = run_online(library.given(PLACE), replace(recorded, context=()))
    never = run_online(library, replace(recorded, context=()))
    assert told == known and told.decided_share < never.decided_share
    assert len(list(merge(recorded.context))) == 1
