# SPDX-License-Identifier: Apache-2.0
"""Real people: recordings that were not learned from are replayed."""

import pytest

from intent_recognition.bags.reader import BagReader
from intent_recognition.demonstrations import load_dofs, read_demonstrations
from intent_recognition.evaluation.replaying import replay
from intent_recognition.learning.training import TrainingSettings, learn
from intent_recognition.model.file import Model

pytestmark = pytest.mark.slow

LEFT_OUT = ("demo_0003", "demo_0014", "demo_0022", "demo_0035")


@pytest.fixture(scope="module")
def learned(shared_data):
    """People with the YuMi arm: the folder, and a model of all but one recording of each task."""
    folder = shared_data / "hri_yumi"
    if not folder.is_dir():
        pytest.skip(f"{folder} is not there")
    dofs = load_dofs(folder / "dofs.yaml")
    demonstrations, rejections = read_demonstrations(folder, dofs)
    assert len(demonstrations) == 28 and not rejections
    library = learn([d for d in demonstrations if d.name not in LEFT_OUT], TrainingSettings())
    return folder, Model(library, dofs)


@pytest.mark.parametrize("name", LEFT_OUT)
def test_a_person_never_seen_in_training_is_recognised(learned, name):
    """By `replay`, which gives the numbers of the nodes: test_replay.py."""
    folder, model = learned
    reader = BagReader(folder / name)
    moving = [row for row in replay(reader, model) if row["probabilities"]["none"] < 1.0]
    late = [max(row["probabilities"], key=row["probabilities"].get) for row in moving]
    late = late[len(late) // 2 :]
    assert late and late.count(reader.custom_data["task"]) > 0.9 * len(late)
