# SPDX-License-Identifier: Apache-2.0
"""`intent train --sessions`: the transition prior of the model file."""

import numpy as np
import pytest
from cli.recorded import DOFS, TRUTH, write_all
from rich.console import Console

from intent_recognition.bags.writer import BagWriter
from intent_recognition.cli.main import main
from intent_recognition.cli.train_sessions import with_sessions
from intent_recognition.errors import BagError
from intent_recognition.learning.transitions import count_transitions, smoothed_transitions
from intent_recognition.model.file import Model, load_model

STRING = "std_msgs/msg/String"
ORDERS = (("task_0", "task_1") * 5, ("task_1", "task_0", "dance", "task_1"))


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    folder = tmp_path_factory.mktemp("recorded")
    write_all(folder)
    for number, order in enumerate(ORDERS):
        write_session(folder / "sessions" / f"session_{number}", order)
    return folder


def write_session(path, order):
    with BagWriter(path) as writer:
        for k, label in enumerate(order):
            for shift, text in ((0, label), (2, "")):
                at_ns = 10**18 + (5 * k + shift) * 10**9
                writer.write_message("demonstration", STRING, {"data": text}, at_ns)


def train(run_command, recorded, output, *more):
    options = ("--dofs", recorded / "dofs.yaml", "--basis", 8, "--output", output, *more)
    code, text = run_command("train", recorded / "bags", *options)
    assert code == 0
    return text, load_model(output).library


@pytest.mark.slow
def test_sessions_give_the_transition_prior_and_nothing_else(run_command, recorded, tmp_path):
    _, plain = train(run_command, recorded, tmp_path / "plain.npz")
    np.testing.assert_array_equal(plain.transition_prior, np.full((3, 2), 0.5))
    sessions = ("--sessions", recorded / "sessions")
    text, library = train(run_command, recorded, tmp_path / "habit.npz", *sessions)
    counts = count_transitions(ORDERS, library.labels)
    np.testing.assert_allclose(library.transition_prior, smoothed_transitions(counts))
    assert library.provenance["sessions"] == ["session_0", "session_1"]
    assert library.provenance["transition_counts"] == counts.astype(int).tolist()
    np.testing.assert_array_equal(library.weight_mean, plain.weight_mean)
    assert "which task follows which" in text and "dance" in text and "no task" in text


def test_sessions_are_looked_for_before_the_work(recorded, tmp_path, capsys):
    words = ["train", str(recorded / "no_bags"), "--output", str(tmp_path / "m.npz")]
    assert main([*words, "--sessions", str(tmp_path / "elsewhere")]) == 1
    assert "elsewhere" in capsys.readouterr().err


def test_sessions_without_a_task_of_the_model_are_refused(recorded, tmp_path):
    write_session(tmp_path / "other", ("dance", "sing"))
    model = Model(TRUTH, DOFS)
    with pytest.raises(BagError, match=r"--sessions.*task_0.*dance, sing"):
        with_sessions(model, [tmp_path / "other"], Console())
    with pytest.raises(BagError, match="without labels"):
        with_sessions(model, [recorded / "bags"], Console())
    with pytest.raises(BagError):
        with_sessions(model, [tmp_path / "elsewhere"], Console())
