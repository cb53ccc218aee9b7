# SPDX-License-Identifier: Apache-2.0
"""Learn and run in one frame: extrinsics of the DOF file in the commands, and what models keep."""

import json
from dataclasses import replace

import numpy as np
import pytest
import yaml
from cli.recorded import DOFS, PER_TASK, TRUTH
from model_builder import WRIST, learned_model, perform, write_recording
from tracking_frames import ENTRY, TRACKER, write_tracked

from intent_recognition.errors import BagError
from intent_recognition.model import (
    TaskFolder,
    check_dofs,
    frames_of,
    load_model,
    merge_frames,
    mixed_frames,
    save_model,
)

WITH = replace(DOFS, extrinsics=(ENTRY,))
NUMBERS = ("weight_mean", "weight_covariance", "noise_variance", "log_duration_mean", "none_margin")


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Folders `world` and `raw`, and their DOF files."""
    folder = tmp_path_factory.mktemp("frames")
    for number in range(PER_TASK * 2):
        recording = perform(TRUTH, number % 2, number, rate_hz=25.0)
        write_recording(folder / "world" / recording.name, recording, DOFS)
        write_tracked(folder / "raw" / recording.name, recording, DOFS)
    (folder / "world.yaml").write_text(yaml.safe_dump(DOFS.to_dict()))
    (folder / "raw.yaml").write_text(yaml.safe_dump(WITH.to_dict()))
    return folder


def replayed(run_command, bag, model):
    code, text = run_command("replay", bag, "--model", model, "--json")
    assert code == 0
    return [list(row["probabilities"].values()) for row in json.loads(text)]


@pytest.mark.slow
def test_raw_recordings_with_extrinsics_are_those_in_the_world(train, run_command, recorded):
    in_world, _ = train(recorded / "world", dofs="world.yaml")
    raw, said = train(recorded / "raw", dofs="raw.yaml")
    expected, found = load_model(in_world), load_model(raw)
    for name in NUMBERS:
        ours, theirs = getattr(found.library, name), getattr(expected.library, name)
        np.testing.assert_allclose(ours, theirs, rtol=1e-6, atol=1e-8, err_msg=name)
    assert found.dofs == WITH and expected.dofs == DOFS
    assert frames_of(found.library) == frames_of(expected.library) == {WRIST.topic: ("world",)}
    assert "recorded in the frames" not in said
    np.testing.assert_allclose(
        replayed(run_command, recorded / "raw" / "demo_03", raw),
        replayed(run_command, recorded / "world" / "demo_03", in_world),
        atol=1e-6,
    )
    code, shown = run_command("inspect", raw)
    assert code == 0 and "frame world" in " ".join(shown.split())
    _, shown = run_command("segment", recorded / "raw" / "demo_03", "--model", raw, "--json",
                           "--output", raw.parent / "parts")  # fmt: skip
    assert [one["task"] for one in json.loads(shown)] == [TRUTH.labels[1]]


@pytest.mark.slow
def test_without_extrinsics_the_recorded_frame_is_kept(train, run_command, recorded):
    path, _ = train(recorded / "raw", dofs="world.yaml")
    model = load_model(path)
    assert frames_of(model.library) == {WRIST.topic: (TRACKER,)}
    _, shown = run_command("inspect", path)
    assert f"frame {TRACKER}" in " ".join(shown.split())
    assert replayed(run_command, recorded / "raw" / "demo_03", path)
    with pytest.raises(BagError, match=r"unknown_frame.*in the frame that"):
        run_command("replay", recorded / "world" / "demo_03", "--model", path)
    two = (recorded / "world" / name for name in ("demo_00", "demo_01"))
    both, said = train(*two, "--add", path, dofs="world.yaml")
    assert f"{WRIST.topic}: recorded in the frames {TRACKER}, world" in said
    assert "extrinsics" in said
    assert frames_of(load_model(both).library) == {WRIST.topic: (TRACKER, "world")}
    two = (recorded / "raw" / name for name in ("demo_00", "demo_01"))
    more, said = train(*two, "--add", path, dofs="world.yaml")
    assert "recorded in the frames" not in said
    assert frames_of(load_model(more).library) == {WRIST.topic: (TRACKER,)}


@pytest.mark.slow
def test_recordings_in_several_frames_are_named(train, run_command, recorded):
    bags = [recorded / ("raw" if k < 4 else "world") / f"demo_{k:02d}" for k in range(8)]
    sentence = f"{WRIST.topic}: recorded in the frames {TRACKER}, world"
    _, said = train(*bags, dofs="raw.yaml")
    assert sentence not in said
    _, said = run_command("evaluate", *bags, "--dofs", recorded / "world.yaml",
                          "--basis", 8, "--unknown-tasks", "off",
                          "--protocol", "temporal:0.5")  # fmt: skip
    assert sentence in said


@pytest.mark.slow
def test_a_folder_of_tasks_learns_in_the_world(tmp_path):
    folder = TaskFolder(tmp_path / "tasks", WITH)
    for number in range(4):
        recording = perform(TRUTH, number % 2, number, rate_hz=25.0)
        bag = folder.new_bag(recording.task)
        folder.learn(write_tracked(bag, recording, DOFS))
    model = load_model(folder.model_path)
    assert model.dofs == WITH and model.library.n_demonstrations.tolist() == [2, 2]
    assert frames_of(model.library) == {WRIST.topic: ("world",)}
    assert TaskFolder(folder.path, DOFS).dofs == WITH


def test_models_from_before_load_and_know_no_frame(tmp_path):
    model = learned_model(DOFS, TRUTH)
    kept = {k: v for k, v in model.library.provenance.items() if k != "frames"}
    for provenance in (kept, kept | {"frames": "world"}, kept | {"frames": {"a": 3}}):
        library, path = replace(model.library, provenance=provenance), tmp_path / "old.npz"
        save_model(path, replace(model, library=library))
        assert frames_of(load_model(path).library) == {}
    assert check_dofs(model, WITH, "mine").extrinsics == (ENTRY,)


def test_frames_are_put_together_topic_by_topic():
    merged = merge_frames([{"a": ("x",)}, {"b": ("z",)}, {"a": ("y", "x")}])
    assert merged == {"a": ("x", "y"), "b": ("z",)}
    assert len(merge_frames([{"a": tuple(map(str, range(99)))}])["a"]) == 10
    (sentence,) = mixed_frames(merged)
    assert sentence.startswith("a: recorded in the frames x, y,")
    (sentence,) = mixed_frames({"mocap/l/pose": ("x",), "mocap/r/pose": ("y",), "b": ("z",)})
    assert sentence.startswith("mocap/l/pose, mocap/r/pose: recorded in the frames x, y,")
