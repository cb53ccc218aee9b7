# SPDX-License-Identifier: Apache-2.0
"""Recordings of the toolbox: reproducible to the byte, and hard for a shortcut on the position."""

import hashlib
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from bag_builder import messages_in
from simulation import gathered

from experiments.recording import write_recording
from experiments.teaching.demonstration import TEST_COUNTS, TRAINING_COUNTS
from experiments.teaching.hardness import (
    draw_set,
    hardness_table,
    measure_hardness,
)
from experiments.teaching.recordings import ToolboxOrder, content, orders
from intent_recognition.bags.metadata import read_metadata
from intent_recognition.demonstrations import load_dofs, read_demonstrations
from intent_recognition.filtering import MovementFilter, fixed_prior_grid
from intent_recognition.kinematics.lwr import JOINT_NAMES
from intent_recognition.learning import TrainingSettings
from intent_recognition.signals import merge
from sim_bridge.coworker.styles import HOLD, PLATE, SCREW, TASKS

FIRST = ToolboxOrder(1, "train", HOLD, 3)


@pytest.mark.slow
def test_same_seed_same_bytes_and_equal_to_what_is_shipped(tmp_path, repository):
    one, two = (
        write_recording(tmp_path / place / FIRST.name, *content(FIRST, tmp_path)) for place in "ab"
    )
    assert messages_in(one) == messages_in(two)
    assert (one / "metadata.yaml").read_bytes() == (two / "metadata.yaml").read_bytes()
    shipped = repository / "bags" / "toolbox" / "train" / FIRST.name
    ours, theirs = messages_in(one), messages_in(shipped)
    assert [(t, s) for t, s, _ in ours] == [(t, s) for t, s, _ in theirs]
    # Poses come from numpy alone; joint states went through the physics engine of the machine.
    poses = [(a, b) for (t, _, a), (_, _, b) in zip(ours, theirs, strict=True) if "mocap" in t]
    assert all(a == b for a, b in poses)


def test_forty_eight_and_twelve_are_shipped_and_read_without_a_rejection(repository):
    folders = sorted((repository / "bags" / "toolbox").glob("*/*"))
    made = {(order.purpose, order.name) for order in orders(1)}
    assert {(folder.parent.name, folder.name) for folder in folders} == made
    data = [read_metadata(folder).custom_data for folder in folders]
    assert all(d["simulated"] == "true" and d["seed"] == "1" for d in data)
    assert Counter((d["set"], d["task"]) for d in data) == {
        ("train", PLATE): 15, ("train", SCREW): 20, ("train", HOLD): 13,
        ("test", PLATE): 4, ("test", SCREW): 4, ("test", HOLD): 4,
    }  # fmt: skip
    for d in data:
        assert int(d["human_onset_ns"]) < int(d["human_end_ns"]) < int(d["robot_arrival_ns"])
        assert float(d["teaching_error_m"]) < 0.04
    sizes = [sum(f.stat().st_size for f in folder.iterdir()) for folder in folders]
    assert max(sizes) < 200_000
    folder = repository / "bags" / "toolbox" / "test"
    found, rejections = read_demonstrations([folder], load_dofs())
    assert len(found) == 12
    assert not rejections
    for demonstration in found:
        assert demonstration.task in TASKS
        assert sum(demonstration.rejected.values()) == 0
        assert demonstration.controlled[0].names == JOINT_NAMES
        assert np.all(np.diff(demonstration.controlled[0].stamps_ns) == 10_000_000)


@pytest.mark.parametrize(
    ("folder", "beside", "most"),
    [
        *(("toolbox", "..", 10_000_000), ("pointing", ".", 5_000_000), ("pouring", ".", 3_000_000)),
        *((folder, ".", 5_000_000) for folder in ("assembly", "pole", "sessions")),
    ],
)
def test_shipped_files_are_those_of_the_checksum_list(repository, folder, beside, most):
    below = repository / "bags" / folder
    root = (below / beside).resolve()
    listed = dict(reversed(line.split()) for line in (root / "SHA256SUMS").read_text().splitlines())
    files = [path for path in below.rglob("*") if path.is_file() and path.name != "SHA256SUMS"]
    found = {
        str(path.relative_to(root)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files
    }
    assert found == listed
    assert sum(path.stat().st_size for path in files) < most


def measured_with(seed):
    return measure_hardness(draw_set(seed, TRAINING_COUNTS, 0), draw_set(seed, TEST_COUNTS, 1))


@pytest.mark.slow
def test_shipped_and_fresh_demonstrations_are_hard_for_the_shortcut_and_easy_for_the_history():
    shipped, *fresh = (measured_with(seed) for seed in (1, *range(100, 106)))
    assert max(m.position_leave_one_out for m in (shipped, *fresh)) <= 0.85
    assert shipped.separation_m > 0.05  # against millimetres of noise
    for some in ([shipped], fresh):
        assert np.mean([m.position_test for m in some]) <= 0.85
        assert np.mean([m.history_leave_one_out for m in some]) >= 0.97
        assert np.mean([m.history_test for m in some]) >= 0.97


@pytest.mark.slow
def test_sets_share_no_movement_and_the_readme_has_what_is_measured(repository):
    train, test = draw_set(1, TRAINING_COUNTS, 0), draw_set(1, TEST_COUNTS, 1)
    assert (len(train), len(test)) == (48, 12)
    goals = np.array([d.reach.goal_m for d in train + test])
    distances = np.linalg.norm(goals[:, None] - goals, axis=2) + np.eye(60)
    assert distances.min() > 1e-3
    assert hardness_table(1) in (repository / "bags" / "README.md").read_text()


@pytest.mark.slow
def test_the_library_recognises_where_a_shortcut_on_the_position_fails(repository):
    """After 30 % of the movement, as the metadata say when the coworker's reach began and ended."""
    train, test = [], []
    for demonstrations, name in ((train, "train"), (test, "test")):
        for one in read_demonstrations(repository / "bags/toolbox" / name, load_dofs())[0]:
            start_ns, end_ns = (int(one.metadata[f"human_{at}_ns"]) for at in ("onset", "end"))
            demonstrations.append(replace(one, start_ns=start_ns, end_ns=end_ns))
    library, right = gathered(train, TrainingSettings(segmentation="recording")).library, []
    for one in test:
        run = MovementFilter(library, fixed_prior_grid(library, one.duration_s), one.start_ns)
        until_ns = one.start_ns + round(0.3 * one.duration_s * 1e9)
        for observation in merge([s.between(one.start_ns, until_ns) for s in one.observed]):
            run.observe(observation)
        probabilities = run.posterior(until_ns).probabilities[:-1]
        right.append(library.labels[np.argmax(probabilities)] == one.task)
    assert np.mean(right) >= 0.95
