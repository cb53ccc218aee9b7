# SPDX-License-Identifier: Apache-2.0
"""Small models and bags of simulated people, for tests of everything that needs a model file."""

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from bag_builder import JOINTS, LWR, POSE
from simulation import gathered, make_library, simulate

from intent_recognition.bags.writer import BagWriter
from intent_recognition.demonstrations.dofs import DofEntry, DofSpec
from intent_recognition.demonstrations.paths import STAMPED_ELEMENTS, ElementName, parse_path
from intent_recognition.learning import TrainingSettings, with_margins
from intent_recognition.model.file import Model
from intent_recognition.promp.library import TaskLibrary
from intent_recognition.signals import POSITION_FIELDS, Demonstration, Signal, from_tangent, merge

WRIST = DofEntry("mocap/wrist/pose", POSE, fields=POSITION_FIELDS, unit="m")
TOOL = DofEntry("tracker/tool", POSE, fields=("pose.position.x", "pose.position.z"), unit="m")
GLOVE = DofEntry("glove/joint_states", JOINTS, joints=("thumb", "index"), unit="rad")
ROBOT = DofEntry("joint_states", JOINTS, joints=tuple(LWR), unit="rad")
SEED = 5
TURNED = (0.5, -0.5, 0.5, 0.5)
"""Orientation (4,) xyzw about which bodies turn where the entry has no reference."""


def make_dofs(*observed: DofEntry) -> DofSpec:
    """The observed entries (the wrist if none), and the arm."""
    return DofSpec(observed or (WRIST,), (ROBOT,))


@cache
def true_library(dofs: DofSpec, n_tasks: int = 3, seed: int = SEED) -> TaskLibrary:
    """What the simulated people do."""
    library = make_library(
        np.random.default_rng(seed),
        n_tasks=n_tasks,
        groups=tuple(len(entry.names) for entry in dofs.observed),
        n_controlled=len(dofs.controlled_names),
        spread=0.03,
        noise_std=0.001,
    )
    return replace(
        library,
        observed_names=dofs.observed_names,
        controlled_names=dofs.controlled_names,
        observed_units=tuple(e.unit for e in dofs.observed for _ in e.names),
        controlled_units=tuple(e.unit for e in dofs.controlled for _ in e.names),
    )


def perform(truth: TaskLibrary, task: int, seed: int, **options) -> Demonstration:
    """One recording with rest before and after, at 50 Hz."""
    options = {"rest_before_s": 0.8, "rest_after_s": 0.8, "name": f"demo_{seed:02d}"} | options
    return simulate(truth, task, np.random.default_rng(seed), **options)


_LEARNED: dict[tuple[DofSpec, int, int], tuple[TaskLibrary, Model]] = {}
"""What was learned in this process already, with the truth, whose id is not used again so."""


def learned_model(dofs: DofSpec, truth: TaskLibrary | None = None, per_task: int = 8) -> Model:
    """A model of simulated recordings, at the usual hyperparameters."""
    truth = truth or true_library(dofs)
    key = (dofs, per_task, id(truth))
    if key not in _LEARNED:
        recordings = [perform(truth, i % truth.n_tasks, i) for i in range(per_task * truth.n_tasks)]
        settings = TrainingSettings(n_basis=10, n_aligned_basis=10)
        trained = with_margins(gathered(recordings, settings))
        _LEARNED[key] = truth, Model(trained.library, dofs)
    return _LEARNED[key][1]


def message_of(entry: DofEntry, stamp_ns: int, values: np.ndarray) -> dict:
    """Fields of a message that carries the entry's DOFs."""
    header = {"stamp": int(stamp_ns), "frame_id": "world"}
    if entry.joints:
        names = [joint.replace("*", "rlkas") for joint in entry.joints]
        return {"header": header, "name": names, "position": list(map(float, values))}
    tree: dict = {}
    for field, value in zip(entry.fields, values, strict=True):
        *parts, last = parse_path(field)
        node = tree
        for part in parts:
            node = node.setdefault(part, {})
        node[last] = float(value)
    if entry.type == POSE:
        tree["pose"].setdefault("orientation", {"w": 1.0})
    arrays = _with_arrays(tree, stamp_ns)
    return arrays if entry.type in STAMPED_ELEMENTS else arrays | {"header": header}


def _with_arrays(tree, stamp_ns):
    """Nested fields, with elements of arrays as lists."""
    if not isinstance(tree, dict):
        return tree
    inner = {key: _with_arrays(value, stamp_ns) for key, value in tree.items()}
    if any(isinstance(key, int) for key in tree):
        return [inner.get(k, {}) for k in range(max(tree) + 1)]
    if any(isinstance(key, ElementName) for key in tree):
        return [_named(key.name, stamp_ns) | value for key, value in inner.items()]
    return inner


def _named(name: str, stamp_ns: int) -> dict:
    """What makes an element of an array the one of that name: a transform, or a marker."""
    stamped = {"header": {"stamp": int(stamp_ns), "frame_id": "world"}}
    namespace, slash, number = name.partition("/")
    return stamped | ({"ns": namespace, "id": int(number)} if slash else {"child_frame_id": name})


def write_recording(
    path: Path, recording: Demonstration, dofs: DofSpec, *, task: str | None = None, **metadata: str
) -> Path:
    """A bag of a recording; the label is the recording's own unless given, none if empty.

    Entries of one topic with the same stamp are in one message.
    """
    label = recording.task if task is None else task
    custom_data = metadata | ({"task": label} if label else {})
    with BagWriter(path, custom_data) as writer:
        for entry, stamp_ns, values in messages_of(recording, dofs):
            fields = message_of(entry, stamp_ns, values)
            writer.write_message(entry.topic, entry.type, fields, stamp_ns)
    return path


def messages_of(
    recording: Demonstration, dofs: DofSpec
) -> Iterator[tuple[DofEntry, int, np.ndarray]]:
    """Entry with all fields of its topic, stamp and values of every message, in order."""
    entries = (*dofs.observed, *dofs.controlled, *dofs.context)
    at: dict[tuple[int, str], tuple[DofEntry, list]] = {}
    controlled, start = [], 0
    for entry in dofs.controlled:
        (robot,) = recording.controlled
        columns = slice(start, start + len(entry.names))
        controlled.append(
            Signal(entry.names, robot.stamps_ns, robot.values[:, columns], entry.unit)
        )
        start = columns.stop
    for o in merge((*recording.observed, *controlled, *recording.context)):
        entry, key = entries[o.group], (o.stamp_ns, entries[o.group].topic)
        known, values = at.get(key, (replace(entry, fields=()), []))
        numbers = o.values
        if entry.orientation:
            numbers = from_tangent(numbers, entry.reference or TURNED)
        at[key] = (replace(known, fields=known.fields + entry.fields), [*values, *numbers])
    for (stamp_ns, _), (entry, values) in at.items():
        yield entry, stamp_ns, np.array(values)
