# SPDX-License-Identifier: Apache-2.0
"""Demonstrations from bags, folders and sessions; what is left out is named, the rest is used."""

import tracemalloc
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
import yaml
from bag_builder import (
    JOINTS,
    POSE,
    START_NS,
    STEP_NS,
    TEXT,
    SteppingClock,
    joints,
    pose,
    write_bag,
    write_pairs,
    write_session,
)

from intent_recognition.bags import BagReader, BagWriter
from intent_recognition.demonstrations import (
    find_bags,
    inspect_bag,
    iter_demonstrations,
    iter_observations,
    read_task_sequences,
)
from intent_recognition.demonstrations import read_demonstrations as read
from intent_recognition.demonstrations.dofs import DofSpec, load_dofs
from intent_recognition.errors import BagError
from intent_recognition.tables import suggest_map

DOFS = load_dofs()
TF = "tf2_msgs/msg/TFMessage"


def test_one_bag_with_or_without_a_label(tmp_path):
    (demonstration,), rejections = read(write_bag(tmp_path / "demo", 50), DOFS)
    assert not rejections
    assert demonstration.name == "demo" and demonstration.task == "plate"
    (wrist,), (arm,) = demonstration.observed, demonstration.controlled
    np.testing.assert_allclose(wrist.values[:, 0], 0.001 * np.arange(50), atol=1e-15)
    assert arm.values[7].tolist() == joints(7)["position"]
    assert (demonstration.start_ns, demonstration.end_ns) == (START_NS, START_NS + 49 * STEP_NS)
    assert dict(demonstration.rejected) == {}
    (demonstration,), _ = read(write_bag(tmp_path / "unlabelled", task=None), DOFS)
    assert demonstration.task is None


@pytest.mark.parametrize("later_s", [0.5, 0.0, 30.0])
@pytest.mark.parametrize("names", [("give_0", "give_1"), ("give", "take")])
def test_files_without_metadata_are_one_bag_where_they_follow_one_another(later_s, names, tmp_path):
    """As rosbag2 splits a recording; other files are demonstrations of their own."""
    (tmp_path / "all").mkdir()
    for k, name in enumerate(names):
        shift = round(k * later_s * 1e9)
        with BagWriter(tmp_path / name) as writer:
            for i in range(50):
                content = pose(i, stamp_ns=START_NS + i * STEP_NS + shift)
                writer.write_message("wrist", POSE, content, START_NS + i * STEP_NS + shift)
        (file,) = (tmp_path / name).glob("*.mcap")
        file.rename(tmp_path / "all" / f"{name}.mcap")
    split = later_s == 0.5 and names[0] == "give_0"
    files = [tmp_path / "all" / f"{name}.mcap" for name in names]
    assert find_bags(tmp_path / "all") == ([tmp_path / "all"] if split else files)
    if split:  # a recorder that was killed at once leaves a part without messages, or bytes
        last = tmp_path / "all" / "give_2.mcap"
        last.write_bytes(files[0].read_bytes()[:30])
        assert find_bags(tmp_path / "all") == [tmp_path / "all"]
        last.write_bytes(b"")
        assert find_bags(tmp_path / "all") == [tmp_path / "all"]
        reader = BagReader(tmp_path / "all")
        assert (reader.message_count, reader.notes[1:]) == (100, ["empty: give_2.mcap"])


def test_bad_poses_are_dropped_and_counted_as_the_node_does(tmp_path):
    poses = [pose(i) for i in range(40)]
    poses[5] = pose(5, x=float("nan"))
    poses[9] = pose(9, x=float("inf"))
    poses[12] = pose(12, stamp_ns=0)
    poses[15] = pose(14)
    poses[20] = pose(20, x=5.0)
    poses[25] = pose(25, frame_id="elsewhere")
    bag = write_pairs(tmp_path / "demo", poses)
    (demonstration,), _ = read(bag, DOFS)
    reasons = dict.fromkeys(("zero_stamp", "stamp_not_increasing", "jump", "unknown_frame"), 1)
    assert demonstration.rejected == reasons | {"not_finite": 2}
    assert demonstration.observed[0].stamps_ns.size == 34
    streamed = Counter()
    seen = list(iter_observations(BagReader(bag), DOFS, rejected=streamed))
    assert streamed == demonstration.rejected
    assert [one.stamp_ns for one in seen] == demonstration.observed[0].stamps_ns.tolist()


@pytest.mark.parametrize("side", ["observed", "controlled"])
@pytest.mark.parametrize("at", [10, 57])
def test_one_sample_from_the_future_does_not_cost_those_after_it(at, side, tmp_path):
    poses, states = ([make(i) for i in range(60)] for make in (pose, joints))
    odd = poses if side == "observed" else states
    odd[at]["header"]["stamp"] += 3_600_000_000_000
    bag = write_pairs(tmp_path / "demo", poses, states)
    (demonstration,), _ = read(bag, DOFS)
    assert demonstration.rejected == {"stamp_not_increasing": 1}
    expected = START_NS + STEP_NS * np.delete(np.arange(60), at)
    np.testing.assert_array_equal(getattr(demonstration, side)[0].stamps_ns, expected)


@pytest.mark.parametrize("is_clock_simulated", [False, True])
@pytest.mark.parametrize("layouts", [1, 20])
@pytest.mark.parametrize("ahead_ns", [0, 3_000_000])
def test_a_gripper_on_the_topic_of_the_arm_costs_none_of_its_states(
    ahead_ns, layouts, is_clock_simulated, tmp_path
):
    """Each publisher has a clock of its own: the stamps of the two need not be in one order."""
    kept = [i for i in range(50) if not 20 < i < 30]
    with BagWriter(tmp_path / "demo") as writer:
        for i in kept:
            log_ns = START_NS + i * STEP_NS
            at_ns = log_ns - START_NS * is_clock_simulated + 5 * STEP_NS
            fingers = {"names": [f"left_{i % layouts}", "right"], "positions": [0.1, 0.2]}
            gripper = joints(i, **fingers, stamp_ns=at_ns + ahead_ns)
            writer.write_message("mocap/wrist/pose", POSE, pose(i, stamp_ns=at_ns), log_ns)
            writer.write_message("joint_states", JOINTS, gripper, log_ns)
            arm = joints(i, stamp_ns=at_ns if i else 0)
            writer.write_message("joint_states", JOINTS, arm, log_ns + 1)
    (found,), _ = read(tmp_path / "demo", DOFS)
    assert found.controlled[0].values.tolist() == [joints(i)["position"] for i in kept[1:]]
    assert found.rejected == {"missing_dof": len(kept), "zero_stamp": 1}
    topic = inspect_bag(tmp_path / "demo").topics[1]
    assert topic.rate_hz == pytest.approx(100.0) and topic.longest_gap_s == pytest.approx(0.1)
    shift_ns = 0 if is_clock_simulated else 5 * STEP_NS  # clocks a moment apart count as one
    at_ns = START_NS + 20 * STEP_NS + shift_ns
    assert [abs(ns - at_ns) <= 3_000_001 for ns, _ in topic.gaps] == [True] * 2
    assert dict(topic.rejected) == {"zero_stamp": 1}


def test_frames_of_tf_have_rates_of_their_own(tmp_path):
    with BagWriter(tmp_path / "demo") as writer:
        for i in range(50):
            for k, frame in enumerate(("wrist", "base", "camera", "slow")[: 3 + (i % 4 == 0)]):
                at_ns = START_NS + i * STEP_NS + k * 1000
                transforms = [{"child_frame_id": frame}, {"child_frame_id": f"{frame}_{i % 2}"}]
                writer.write_message("tf", TF, {"transforms": transforms}, at_ns)
    (topic,) = inspect_bag(tmp_path / "demo").topics
    assert topic.rate_hz == pytest.approx(100.0) and not topic.gaps


def test_a_topic_that_is_left_empty_has_its_own_counts(tmp_path):
    poses = [pose(i, stamp_ns=0) for i in range(30)]
    states = [joints(i, positions=[float("nan")] * 7) for i in range(30)]
    _, (rejection,) = read(write_pairs(tmp_path / "demo", poses, states), DOFS)
    assert rejection.topic == "/mocap/wrist/pose" and not rejection.stamp_ns
    assert rejection.reason == "empty: 0 usable samples (30 zero_stamp)"
    assert rejection.cure == "Fill in header.stamp before publishing."
    _, (rejection,) = read(write_pairs(tmp_path / "arm", [pose(0), *poses[1:]], states), DOFS)
    assert rejection.reason == "empty: 1 usable samples (29 zero_stamp)"
    _, (rejection,) = read(
        write_pairs(tmp_path / "both", [pose(i) for i in range(30)], states), DOFS
    )
    assert rejection.topic == "/joint_states"
    assert rejection.reason == "empty: 0 usable samples (30 not_finite)"  # not two clocks


def test_folder_with_broken_bags_uses_the_rest(tmp_path):
    for name in ("a", "c", "e", "g"):
        write_bag(tmp_path / name, task=name)
    data = (tmp_path / "c" / "c_0.mcap").read_bytes()
    (tmp_path / "c" / "c_0.mcap").write_bytes(data[: len(data) * 2 // 3])
    (tmp_path / "e" / "e_0.mcap").unlink()
    (tmp_path / "g" / "metadata.yaml").write_text("nonsense")
    with BagWriter(tmp_path / "i") as writer:
        writer.write_message("joint_states", JOINTS, joints(0), START_NS)
    with BagWriter(tmp_path / "k") as writer:
        writer.write_message("joint_states", JOINTS, joints(0), START_NS)
        writer.write_message("mocap/wrist/pose", TEXT, {"data": "x"}, START_NS)
    with BagWriter(tmp_path / "m") as writer:
        writer.add_topic("mocap/wrist/pose", POSE)
        writer.add_topic("joint_states", JOINTS)
    write_bag(tmp_path / "z", task="z")
    (tmp_path / "figures").mkdir()
    demonstrations, rejections = read(tmp_path, DOFS)
    assert [d.task for d in demonstrations] == ["a", "z"]
    reasons = {r.path.rsplit("/", 1)[1]: r.reason for r in rejections}
    expected = {
        "c": "damaged",
        "e": "e_0.mcap",
        "g": "metadata.yaml",
        "i": "missing topic",
        "k": "wrong schema",
        "m": "empty",
    }
    assert reasons.keys() == expected.keys()
    assert all(expected[name] in reason for name, reason in reasons.items())
    assert [str(r).startswith(str(tmp_path)) for r in rejections] == [True] * 6


def test_a_bag_cut_before_the_first_message_of_a_topic_is_damaged(tmp_path):
    bag = write_bag(tmp_path / "cut")
    file = bag / "cut_0.mcap"
    file.write_bytes(file.read_bytes()[:4000])
    _, (rejection,) = read(bag, DOFS)
    assert rejection.topic and not rejection.stamp_ns
    assert rejection.reason.startswith("damaged: truncated") and "no message" in rejection.reason


BAD_LABELS = ("bad/label", "x" * 300, "a\x1b[2J", "-rf", "none")


def test_labels_that_name_no_task_are_left_out_by_bag(tmp_path):
    for number, label in enumerate(BAD_LABELS):
        write_bag(tmp_path / f"bad_{number}", task=label)
    write_bag(tmp_path / "good", task="give cup")
    demonstrations, rejections = read(tmp_path, DOFS)
    assert [d.task for d in demonstrations] == ["give cup"]
    assert [Path(r.path).name for r in rejections] == [f"bad_{n}" for n in range(len(BAD_LABELS))]
    for rejection in rejections:
        assert rejection.reason.startswith("label: task: expected a label")
        assert rejection.reason.isprintable() and len(rejection.reason) < 250


def test_a_part_of_a_session_with_such_a_label_is_left_out(tmp_path):
    bag = write_session(tmp_path / "session", ["plate", "a/b", "screw"])
    demonstrations, (rejection,) = read(bag, DOFS)
    assert [d.task for d in demonstrations] == ["plate", "screw"]
    assert "'a/b'" in rejection.reason and rejection.stamp_ns == START_NS + 35 * STEP_NS
    assert inspect_bag(bag).unfinished == (rejection,)
    sequences, (rejection,) = read_task_sequences([bag], 60.0)
    assert not sequences and "'a/b'" in rejection.reason


def test_killed_recording_is_left_out_with_the_cure(tmp_path):
    writer = BagWriter(tmp_path / "demo")
    for i in range(30):
        writer.write_message("mocap/wrist/pose", POSE, pose(i), START_NS + i)
        writer.write_message("joint_states", JOINTS, joints(i), START_NS + i)
    writer.flush()
    demonstrations, (rejection,) = read(tmp_path, DOFS)
    assert not demonstrations and "intent recover" in str(rejection)
    writer.close()


@pytest.mark.slow
def test_session_is_split_at_its_markers(tmp_path):
    bag = write_session(tmp_path / "session", ["plate", "screw", "plate"])
    demonstrations, rejections = read(bag, DOFS)
    assert not rejections
    assert [d.task for d in demonstrations] == ["plate", "screw", "plate"]
    assert [d.name for d in demonstrations] == ["session#000", "session#001", "session#002"]
    for number, demonstration in enumerate(demonstrations):
        first = 30 * number + 5
        assert demonstration.start_ns == START_NS + first * STEP_NS
        assert demonstration.end_ns == START_NS + (first + 20) * STEP_NS
        assert demonstration.observed[0].stamps_ns.size == 21
    summary = inspect_bag(bag)
    assert [part.task for part in summary.demonstrations] == ["plate", "screw", "plate"]


def test_session_without_its_last_end(tmp_path):
    bag = write_session(tmp_path / "session", ["plate", "screw"], last_end=False)
    (demonstration,), (rejection,) = read(bag, DOFS)
    assert demonstration.task == "plate"
    assert "screw" in rejection.reason and rejection.stamp_ns == START_NS + 35 * STEP_NS


def test_truncated_session_keeps_what_was_complete(tmp_path):
    clock = SteppingClock(0.05)
    bag = write_session(tmp_path / "session", ["plate", "screw", "plate", "screw"], clock=clock)
    file = bag / "session_0.mcap"
    data = file.read_bytes()
    file.write_bytes(data[: len(data) * 3 // 5])
    demonstrations, rejections = read(bag, DOFS)
    assert [d.task for d in demonstrations] == ["plate", "screw", "plate"][: len(demonstrations)]
    assert demonstrations
    assert "damaged" in rejections[-1].reason


def test_iterating_gives_the_same_in_order_and_nothing_is_named(tmp_path):
    with pytest.raises(BagError, match="nowhere"):
        read(tmp_path / "nowhere", DOFS)
    none, (rejection,) = read(tmp_path, DOFS)
    assert not none and "no bag" in rejection.reason
    for name in ("b", "a"):
        write_bag(tmp_path / name, task=name)
    found = list(iter_demonstrations([tmp_path / "b", tmp_path], DOFS))
    assert [d.task for d in found] == ["b", "a", "b"]


@pytest.mark.parametrize(("folder", "count"), [("nuisi", 29), ("hri_yumi", 28), ("baton", 68)])
def test_real_recordings(shared_data, folder, count):
    dofs = load_dofs(shared_data / folder / "dofs.yaml")
    demonstrations, rejections = read(shared_data / folder, dofs)
    assert len(demonstrations) == count and not rejections
    assert all(d.task for d in demonstrations)
    shares = [d.rejected.get("jump", 0) / d.observed[0].stamps_ns.size for d in demonstrations]
    assert max(shares) < 0.05


def test_inspection_holds_no_images(tmp_path):
    image = {"header": {"stamp": START_NS}, "data": np.zeros(2**20, np.uint8)}
    with BagWriter(tmp_path / "bag") as writer:
        for i in range(40):
            writer.write_message("camera", "sensor_msgs/msg/Image", image, START_NS + i * STEP_NS)
    tracemalloc.start()
    (camera,) = inspect_bag(tmp_path / "bag").topics
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert camera.rejected == {"stamp_not_increasing": 39} and peak < 20 * 2**20


def test_a_session_whose_streams_are_on_two_clocks_says_so(tmp_path):
    off_ns = 300_000_000_000
    with BagWriter(tmp_path / "session") as writer:
        for step in range(60):
            at_ns = START_NS + step * STEP_NS
            writer.write_message("mocap/wrist/pose", POSE, pose(step), at_ns)
            writer.write_message("joint_states", JOINTS, joints(0, stamp_ns=at_ns - off_ns), at_ns)
            if step in (5, 50):
                mark = {"data": "plate" if step == 5 else ""}
                writer.write_message("demonstration", TEXT, mark, at_ns)
    (rejected,) = iter_demonstrations(tmp_path / "session", DOFS)
    assert "two clocks" in rejected.reason


@pytest.mark.parametrize(
    ("side", "key", "names", "says"),
    [
        ("controlled", "joints", ["lwr_a1_joint", "a2"], "no joint a2: the topic has lwr_a1_joint"),
        ("observed", "fields", ["pose.position.x", "pose.position.q"], "no field pose.position.q"),
    ],
)
def test_a_misspelt_joint_or_field_is_named(tmp_path, side, key, names, says):
    content = DOFS.to_dict()
    content[side][0][key] = names
    found, (rejection,) = read(write_bag(tmp_path / "bag"), DofSpec.from_dict(content))
    assert not found and says in str(rejection) and "clocks" not in str(rejection)


def test_joints_that_are_never_in_one_message_and_a_missing_quantity_are_named(tmp_path):
    poses = [pose(i) for i in range(60)]
    arm = [joints(i, names=["a", "b"], positions=[0.01 * i, 0.0]) for i in range(60)]
    hand = [joints(i, names=["g"], positions=[0.5]) for i in range(60)]
    both = write_pairs(tmp_path / "both", poses, [(arm, hand)[i % 2][i] for i in range(60)])
    effort = [state | {"position": [], "effort": [1.0, 2.0]} for state in arm]
    bare = [state | {"name": []} for state in arm]
    content = DOFS.to_dict()
    (entry,) = content["controlled"]
    for bag, names, says in (
        (both, ["a", "g"], "no message has all joints once, they have a, b; g: write an entry for"),
        (write_pairs(tmp_path / "effort", poses, effort), ["a"], "no position: the topic has effo"),
        (write_pairs(tmp_path / "bare", poses, bare), ["a"], "no joint a: the topic has no names"),
    ):
        content["controlled"] = [entry | {"joints": names}]
        found, (rejection,) = read(bag, DofSpec.from_dict(content))
        assert not found and says in rejection.reason
    content["controlled"] = [entry | {"joints": names} for names in (["a", "b"], ["g"])]
    (found,), _ = read(both, DofSpec.from_dict(content))
    assert [len(one.stamps_ns) for one in found.controlled] == [30, 30]
    suggested = yaml.safe_load(suggest_map(both))
    assert [one["joints"] for one in suggested["controlled"]] == [["a", "b"], ["g"]]
    assert "controlled" not in yaml.safe_load(suggest_map(tmp_path / "effort"))
