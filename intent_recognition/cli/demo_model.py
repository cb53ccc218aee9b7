# SPDX-License-Identifier: Apache-2.0
"""The model of a demo: trained and cached, or checked if the user names one."""

import os
import time
from collections.abc import Iterable
from contextlib import suppress
from hashlib import blake2b
from pathlib import Path

from rich.console import Console

from intent_recognition import durable
from intent_recognition.cli.console import say
from intent_recognition.cli.demo_scene import Scene
from intent_recognition.demonstrations import load_dofs
from intent_recognition.errors import DofError
from intent_recognition.learning import TrainingSettings
from intent_recognition.model import load_model, save_model
from intent_recognition.motion import is_hand
from intent_recognition.share import share_path


def check_model(path: Path, scene: Scene) -> None:
    """Require that a model observes and controls only what the scenario has."""
    shown = load_dofs(share_path(scene.dofs)) if scene.dofs else load_dofs()
    both = (load_model(path).dofs, shown)
    compared = {"observes": [{entry.topic for entry in dofs.observed} for dofs in both]}
    if not any(is_hand(dofs.controlled_message_names) for dofs in both):
        compared["controls"] = [set(dofs.controlled_message_names) for dofs in both]
    for does, (got, expected) in compared.items():
        if not got <= expected:
            cure = "Use a model of this scenario, or leave --model out to train one."
            what = f"a model that {does} {', '.join(sorted(expected))}"
            raise DofError.about(str(path), what, ", ".join(sorted(got)), cure)


def trained_model(path: Path, console: Console, scene: Scene) -> Path:
    """Write the model of a scene; it is cached by the content of recordings and code."""
    from intent_recognition.cli.train import print_library, train, with_sessions

    started = time.monotonic()
    dofs = share_path(scene.dofs) if scene.dofs else None
    learned_from = [share_path(p) for p in (scene.bags, scene.sessions, scene.dofs) if p]
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "intent_recognition"
    kept = cache / f"{content_key([Path(__file__).parents[1], *learned_from])}.npz"
    if kept.is_file():
        durable.copy(kept, path)
        say(console, f"trained before, from the same recordings: {kept}")
        return path
    model, report = train([share_path(scene.bags)], dofs, TrainingSettings(), console)
    print_library(console, model.library, report)
    if scene.sessions:
        model = with_sessions(model, [share_path(scene.sessions)], console)
    save_model(path, model, report.trained)
    console.print(f"trained in {time.monotonic() - started:.1f} s")
    with suppress(OSError):  # an unwritable home only costs a new training
        cache.mkdir(parents=True, exist_ok=True)
        older = sorted(cache.glob("*.npz"), key=lambda file: file.stat().st_mtime)
        for file in older[:-3]:  # keep four: two scenarios in two versions
            file.unlink()
        durable.copy(path, kept)
    return path


def content_key(paths: Iterable[Path]) -> str:
    """Digest of the names and contents of files, and of all files in folders."""
    digest = blake2b(digest_size=16)
    for path in paths:
        for file in sorted(path.rglob("*")) if path.is_dir() else [path]:
            if file.is_file() and file.suffix != ".pyc":
                digest.update(file.relative_to(path.parent).as_posix().encode() + b"\0")
                digest.update(file.read_bytes())
    return digest.hexdigest()
