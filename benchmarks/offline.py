# SPDX-License-Identifier: Apache-2.0
"""What learning and evaluating cost."""

import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path

from benchmarks.measure import Result, at_most
from intent_recognition.demonstrations import load_dofs, read_demonstrations
from intent_recognition.evaluation import evaluate
from intent_recognition.learning import TrainingSettings, learn
from intent_recognition.model import Model, save_model
from intent_recognition.promp import TaskLibrary
from intent_recognition.signals import Demonstration


@contextmanager
def model_file(library: TaskLibrary) -> Iterator[Path]:
    """The file of a model of the toolbox, in a folder of its own that goes with the context."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.npz"
        save_model(path, Model(library, load_dofs()))
        yield path


def bags_to_model(folder: Path) -> tuple[Result, TaskLibrary, list[Demonstration]]:
    """From bags to a model file, in its parts; also what came of it."""
    dofs = load_dofs()
    marks = [time.perf_counter()]
    demonstrations, _ = read_demonstrations(folder, dofs)
    marks.append(time.perf_counter())
    library = learn(demonstrations, TrainingSettings())
    marks.append(time.perf_counter())
    with tempfile.TemporaryDirectory() as temporary:
        save_model(Path(temporary) / "model.npz", Model(library, dofs))
    marks.append(time.perf_counter())
    read_s, learn_s, save_s = (b - a for a, b in pairwise(marks))
    parts = f"once: {read_s:.2f} s reading, {learn_s:.2f} s learning, {save_s:.2f} s writing"
    n = len(demonstrations)
    name = f"{n} demonstrations, bags to model"
    result = at_most(name, marks[-1] - marks[0], 10.0, "s", parts)
    return result, library, demonstrations


def evaluation(demonstrations: Sequence[Demonstration]) -> Result:
    """One fold of leave-one-out: learn from the rest, score the one."""
    rest = list(range(1, len(demonstrations)))
    start = time.perf_counter()
    evaluate(demonstrations, [(rest, [0])], TrainingSettings(segmentation="recording"))
    return at_most(
        f"one fold of {len(demonstrations)}, learned and scored",
        time.perf_counter() - start,
        10.0,
        "s",
        "once",
    )
