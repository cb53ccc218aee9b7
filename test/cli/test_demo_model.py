# SPDX-License-Identifier: Apache-2.0
"""The demo's model is kept until its recordings, or the code, are others."""

from types import SimpleNamespace

import pytest
from rich.console import Console

from intent_recognition.cli import demo_model as demo
from intent_recognition.cli import train as training


def test_a_second_demo_of_the_same_recordings_does_not_train(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(demo, "save_model", lambda path, model, trained: path.write_text(model))
    monkeypatch.setattr(training, "print_library", lambda *_: None)
    monkeypatch.setattr(demo, "share_path", lambda name: tmp_path / name)
    scene = SimpleNamespace(dofs="", bags="bags", sessions="")
    (tmp_path / "bags").mkdir()
    trained = []

    def train(bags, *_):
        trained.append((tmp_path / "bags" / "one").read_text())
        return Model(trained[-1]), SimpleNamespace(trained=None)

    class Model(str):
        library = None

    monkeypatch.setattr(training, "train", train)
    for content in ("a", "a", "b", "a"):
        (tmp_path / "bags" / "one").write_text(content)
        assert (
            demo.trained_model(tmp_path / "model.npz", Console(quiet=True), scene).read_text()
            == content
        )
    assert trained == ["a", "b"]


@pytest.mark.parametrize("change", ["content", "name"])
def test_the_key_is_of_names_and_contents(tmp_path, change):
    (tmp_path / "one").write_text("a")
    before = demo.content_key([tmp_path])
    if change == "content":
        (tmp_path / "one").write_text("b")
    else:
        (tmp_path / "one").rename(tmp_path / "two")
    assert demo.content_key([tmp_path]) != before
