# SPDX-License-Identifier: Apache-2.0
"""`--sessions`: learn from session bags which task follows which."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from rich.console import Console

from intent_recognition.cli.console import boxed_table, say
from intent_recognition.cli.rejections import print_left_out
from intent_recognition.demonstrations import read_task_sequences
from intent_recognition.errors import BagError
from intent_recognition.learning import count_transitions, smoothed_transitions
from intent_recognition.model import Model
from intent_recognition.promp import TaskLibrary
from intent_recognition.recognition import FORGET_AFTER_S


def with_sessions(model: Model, sessions: Sequence[Path], console: Console) -> Model:
    """The model with the transition prior of recorded sessions; as it is when there are none."""
    if not sessions:
        return model
    library = model.library
    sequences, rejections = read_task_sequences(sessions, FORGET_AFTER_S)
    print_left_out(console, rejections)
    counts = count_transitions([sequence.tasks for sequence in sequences], library.labels)
    if not counts.sum():
        seen = sorted({task for sequence in sequences for task in sequence.tasks})
        expected = f"recordings in which {', '.join(library.labels)} follow one another"
        got = f"labels {', '.join(seen)}" if seen else f"{len(rejections)} bags without labels"
        cure = "Give session bags with `demonstration` or `intent/active_task` labels."
        raise BagError.about("--sessions", expected, got, cure)
    names = [Path(sequence.source).name for sequence in sequences]
    provenance = {
        **library.provenance,
        "sessions": list(dict.fromkeys(names)),
        "transition_counts": counts.astype(int).tolist(),
    }
    learned = replace(library, transition_prior=smoothed_transitions(counts), provenance=provenance)
    unknown = {t for sequence in sequences for t in sequence.tasks} - set(library.labels)
    for label in sorted(unknown):
        say(console, f"passed over in sessions: {label}, no task of the model", "yellow")
    print_transitions(console, learned, int(counts.sum()))
    return replace(model, library=learned)


def print_transitions(console: Console, library: TaskLibrary, n_seen: int) -> None:
    """A table of p(next | last)."""
    title = f"which task follows which, from {n_seen} tasks in sessions"
    table = boxed_table(title, "after", *(f">{label}" for label in library.labels))
    for label, row in zip((*library.labels, "no task"), library.transition_prior, strict=True):
        table.add_row(label, *(f"{p:.2f}" for p in row))
    console.print(table)
