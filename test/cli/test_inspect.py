# SPDX-License-Identifier: Apache-2.0
"""`intent inspect` on real little bags, folders and models."""

import json

import numpy as np
import pytest
from bag_builder import JOINTS, POSE, START_NS, STEP_NS, joints, pose, write_bag, write_session
from moved_box import DOFS as BOX_DOFS
from moved_box import learned
from rich.console import Console

from intent_recognition.bags import BagReader, BagWriter
from intent_recognition.cli.inspect_bag import moment
from intent_recognition.demonstrations import load_dofs, read_demonstrations
from intent_recognition.errors import BagError, IntentError, ModelError
from intent_recognition.learning import TrainingSettings, learn_with_report
from intent_recognition.model.file import Model, load_model, save_model
from intent_recognition.model.history import HISTORY, START


def row_of(output: str, start: str) -> list[str]:
    """Cells of the first line that begins with `start`."""
    return next(line for line in output.splitlines() if line.startswith(start)).split()


@pytest.fixture
def flawed_bag(tmp_path):
    """A pose stream with an outlier, a value that is not finite, and a gap of 0.5 s."""
    with BagWriter(tmp_path / "flawed", {"task": "plate", "group": "p1"}) as writer:
        for i in range(60):
            late_ns = 500_000_000 if i >= 40 else 0
            stamp_ns = START_NS + i * STEP_NS + late_ns
            x = {10: 5.0, 20: float("nan")}.get(i)
            message = pose(i, x, stamp_ns=stamp_ns)
            writer.write_message("mocap/wrist/pose", POSE, message, stamp_ns)
            if i < 30:
                writer.write_message("joint_states", JOINTS, joints(i), stamp_ns)
    return tmp_path / "flawed"


def test_a_bag_shows_topics_labels_gaps_and_outliers(run_command, flawed_bag):
    code, output = run_command("inspect", flawed_bag)
    assert code == 0
    assert row_of(output, "task")[1:] == ["plate"]
    assert row_of(output, "group")[1:] == ["p1"]
    cells = row_of(output, "/mocap/wrist/pose")
    assert cells[1:5] == ["60", "100.0", "1", "0.510"]
    assert row_of(output, POSE)
    assert "1 not_finite" in output
    assert "1 jump" in output
    assert "gaps in /mocap/wrist/pose: 0.510 s at 0.39 s" in output
    assert row_of(output, "/joint_states")[1:3] == ["30", "100.0"]
    content = json.loads(run_command("inspect", flawed_bag, "--json")[1])
    pose_topic = next(t for t in content["topics"] if t["name"] == "/mocap/wrist/pose")
    assert (content["task"], content["message_count"], pose_topic["count"]) == ("plate", 90, 60)
    assert content["duration_s"] == pytest.approx(59 * 0.01 + 0.5)
    assert pose_topic["rejected"] == {"jump": 1, "not_finite": 1}
    assert pose_topic["not_finite"] == 1
    assert pose_topic["gaps"] == [[START_NS + 39 * STEP_NS, pytest.approx(0.51)]]


def test_several_recordings_and_a_model_in_one_call(run_command, tmp_path, model_file):
    bags = [write_bag(tmp_path / name, task="plate") for name in ("a", "b")]
    code, output = run_command("inspect", *bags, model_file)
    assert code == 0
    assert row_of(output, "a ")[1] == row_of(output, "b ")[1] == "plate"
    assert "2 bags: plate 2" in output
    _, output = run_command("inspect", model_file, *bags, "--json")
    assert [next(iter(one)) for one in json.loads(output)][1:] == ["path", "path"]


def test_a_folder_gives_one_line_per_bag_and_counts_tasks(run_command, tmp_path):
    for name, task in (("a", "plate"), ("b", "plate"), ("c", "screw"), ("d", None)):
        write_bag(tmp_path / name, task=task)
    code, output = run_command("inspect", tmp_path)
    assert code == 0
    assert [line.split()[0] for line in output.splitlines()[1:5]] == ["a", "b", "c", "d"]
    assert "4 bags: (no label) 1, plate 2, screw 1" in output.splitlines()
    write_bag(tmp_path / "folder" / "one", task="plate")
    assert "1 bag: plate 1" in run_command("inspect", tmp_path / "folder")[1]


def test_no_name_is_broken_in_80_columns(run_command, tmp_path, repository, monkeypatch):
    console = Console(width=80, markup=False, highlight=False)
    monkeypatch.setattr("intent_recognition.cli.output.make_console", lambda: console)
    bags = repository / "bags/toolbox/test"
    _, output = run_command("inspect", bags)
    assert row_of(output, "hold_screwdriver_00")[1] == "hold_screwdriver"
    _, output = run_command("inspect", bags / "hold_screwdriver_00")
    assert row_of(output, "/joint_states") and row_of(output, POSE)
    told = {"time": "2026-11-28T06:27:00", "action": START, "task": "", "bag": "", "model": ""}
    history = told | {"tasks": {"hold_screwdriver": 13}}
    (tmp_path / HISTORY).write_text(json.dumps(history) + "\n", encoding="utf-8")
    _, output = run_command("inspect", tmp_path)
    assert "\nhold_screwdriver" in output and "2026-11-28 06:27  the first model " in output


def test_an_unreadable_bag_is_named_and_the_rest_shown(run_command, tmp_path):
    write_bag(tmp_path / "good")
    (tmp_path / "bad").mkdir()
    (tmp_path / "bad" / "bad_0.mcap").write_bytes(b"no recording")
    code, output = run_command("inspect", tmp_path, "--json")
    by_path = {entry["path"].rsplit("/", 1)[1]: entry for entry in json.loads(output)}
    assert by_path["good"]["message_count"] == 100
    broken = by_path["bad"]
    assert "error" in broken or broken["damage"]
    assert code == 1


def test_a_session_shows_its_demonstrations(run_command, tmp_path):
    write_session(tmp_path / "session", ["plate", "screw"], last_end=False)
    _, output = run_command("inspect", tmp_path / "session")
    assert row_of(output, "0")[1:] == ["plate", "0.05", "0.20"]
    assert "left out" in output


def test_damage_is_shown_not_raised(run_command, tmp_path):
    bag = write_bag(tmp_path / "cut", count=2000)
    file = next(bag.glob("*.mcap"))
    file.write_bytes(file.read_bytes()[:-3000])
    code, output = run_command("inspect", bag)
    assert code == 1
    assert "damaged at byte" in output
    write_bag(tmp_path / "whole")
    code, output = run_command("inspect", tmp_path)
    assert code == 1 and "1 damaged" in output


def test_the_length_of_a_cut_bag_is_of_what_can_be_read(run_command, tmp_path):
    bag = write_bag(tmp_path / "cut", count=2000)
    file = next(bag.glob("*.mcap"))
    file.write_bytes(file.read_bytes()[:70_000])
    _, output = run_command("inspect", bag, "--json")
    content = json.loads(output)
    times_ns = [m.log_time_ns for m in BagReader(bag, tolerant=True).raw_messages()]
    assert content["end_ns"] == max(times_ns) < START_NS + 1900 * STEP_NS


def test_nothing_to_inspect_is_an_error(run_command, tmp_path):
    notes, missing = tmp_path / "notes.txt", tmp_path / "missing"
    model = missing.with_suffix(".npz")
    for path, error in ((tmp_path, BagError), (missing, BagError), (model, ModelError)):
        with pytest.raises(error, match=str(path)):
            run_command("inspect", path)
    notes.write_text("hello", encoding="utf-8")
    with pytest.raises(BagError, match="expected a recording, got another kind of file"):
        run_command("inspect", notes)


@pytest.fixture(scope="module")
def model_file(tmp_path_factory):
    folder, rng = tmp_path_factory.mktemp("learned"), np.random.default_rng(3)
    for number in range(4):
        task = ("plate", "screw")[number % 2]
        with BagWriter(folder / f"bag{number}", {"task": task}) as writer:
            side = rng.normal(1.0 if task == "plate" else -1.0, 0.05)
            for i in range(200):
                at_ns = START_NS + i * STEP_NS
                share = np.clip((i - 20) / 150, 0.0, 1.0)
                reach = share**2 * (3 - 2 * share)
                writer.write_message("mocap/wrist/pose", POSE, pose(i, 0.4 * side * reach), at_ns)
                angles = [side * reach * (j + 1) / 10 for j in range(7)]
                writer.write_message("joint_states", JOINTS, joints(i, positions=angles), at_ns)
    dofs = load_dofs()
    demonstrations, _ = read_demonstrations([folder], dofs)
    settings = TrainingSettings(n_basis=6, n_aligned_basis=9, segmentation="recording")
    provenance = {"bags": ["bag0", "bag1"], "transition_counts": [[0, 2], [1, 0], [1, 1]]}
    report = learn_with_report(demonstrations, settings, provenance)
    save_model(folder / "m.npz", Model(report.library, dofs))
    return folder / "m.npz"


def test_a_model_shows_what_was_learned(run_command, model_file):
    library = load_model(model_file).library
    code, output = run_command("inspect", model_file)
    assert code == 0
    for k, label in enumerate(library.labels):
        cells = row_of(output, label)
        assert cells[1:3] == ["2", f"{library.durations_s[k]:.2f}"]
    for name in (*library.observed_names, *library.controlled_names):
        assert name in output
    assert "from 2 bags: bag0, bag1" in output and "which task follows which" in output
    for words in (
        "evidence that a known task",
        "over staying",
        "(smoothness",
        "(of slopes",
        "less is better",
    ):
        assert words in " ".join(output.split())
    content = json.loads(run_command("inspect", model_file, "--json")[1])
    assert list(content["tasks"]) == list(library.labels)
    assert content["tasks"]["plate"]["median_duration_s"] == library.durations_s[0]
    assert content["controlled"]["lwr_a1_joint"] == "rad"
    stds = [content["noise_std"][n] for n in (*library.observed_names, *library.controlled_names)]
    np.testing.assert_allclose(np.square(stds), library.noise_variance)


@pytest.mark.slow
def test_a_model_s_context_is_shown(run_command, tmp_path):
    save_model(tmp_path / "box.npz", Model(learned().library, BOX_DOFS))
    _, output = run_command("inspect", tmp_path / "box.npz")
    rows = [line.split()[1] for line in output.splitlines() if line.startswith("context ")]
    assert rows == list(BOX_DOFS.context_names)
    _, output = run_command("inspect", tmp_path / "box.npz", "--json")
    assert json.loads(output)["context"] == dict.fromkeys(BOX_DOFS.context_names, "m")


@pytest.mark.parametrize(
    "words", [("inspect",), ("train", "--output", "m.npz"), ("evaluate",), ("replay",)]
)
def test_a_table_is_to_be_imported(words, run_command, tmp_path, model_file):
    folder = tmp_path / "tables"
    (folder / "data").mkdir(parents=True)
    (folder / "data/walk.csv").write_text("time,x\n0,1\n")
    more = ("--model", model_file) if words == ("replay",) else ()
    for path in (folder, folder / "data/walk.csv"):
        with pytest.raises(IntentError, match=r"`intent import .* --suggest` .*docs/import.md"):
            run_command(*words, path, *more)


def test_messages_of_a_chunk_that_cannot_be_read_do_not_count(run_command, tmp_path):
    bag = write_bag(tmp_path / "flipped")
    file = next(bag.glob("*.mcap"))
    data = bytearray(file.read_bytes())
    data[len(data) // 2] ^= 0xFF
    file.write_bytes(data)
    _, output = run_command("inspect", bag, "--json")
    content = json.loads(output)
    n_readable = len(list(BagReader(bag, tolerant=True).raw_messages()))
    assert content["message_count"] == n_readable < 200 and content["damage"]
    assert content["duration_s"] < 0.5


def test_moments_of_simulated_clocks_are_plain_seconds():
    assert moment(1_500_000_000) == "t = 1.500 s"
    assert moment(START_NS) == "2023-11-14 22:13:20.000 UTC"


def test_an_empty_bag_is_a_problem(run_command, tmp_path):
    for name in ("empty_00", "empty_01"):
        write_bag(tmp_path / name, count=0)
    assert "note: it holds no messages" in run_command("inspect", tmp_path / "empty_00")[1]
    assert "it holds no messages" in " ".join(run_command("inspect", tmp_path)[1].split())
