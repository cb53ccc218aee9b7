# SPDX-License-Identifier: Apache-2.0
"""A recording that lies elsewhere than the others of its task is named, with the slip."""

from dataclasses import replace

import numpy as np
import pytest
from simulation import START_NS, minimum_jerk

from intent_recognition.demonstrations import load_dofs, read_demonstrations
from intent_recognition.signals import Demonstration, Signal, stream_doubts, summarise

TIMES_S = np.arange(0.0, 3.0, 0.02)
STAMPS_NS = START_NS + np.round(TIMES_S * 1e9).astype(np.int64)
GOALS = {"plate": [0.45, 0.25, 0.45], "screw": [0.5, -0.45, 0.2]}
POSTURES = {"plate": [0.5, -0.2, 0.1, 1.6], "screw": [-0.5, 0.3, 0.6, 0.9]}


def take(rng: np.random.Generator, task: str, number: int = 0) -> Demonstration:
    """A reach from about one place to about another, and four joints that follow it."""
    done = minimum_jerk((TIMES_S - 0.4) / (1.6 + 0.1 * rng.normal()))[:, None]
    start = np.array([0.9, -0.1, 0.2]) + 0.02 * rng.normal(size=3)
    away = 0.05 * rng.normal(size=3)
    wrist = start + done * (np.array(GOALS[task]) + away - start)
    home = np.array([0.1, -0.6, 0.2, 1.2])
    joints = home + done * (np.array(POSTURES[task]) + np.append(away, 0.0) - home)
    human = Signal(("x", "y", "z"), STAMPS_NS, wrist, "m")
    robot = Signal(("a1", "a2", "a3", "a4"), STAMPS_NS, joints, "rad")
    ends = int(STAMPS_NS[0]), int(STAMPS_NS[-1])
    return Demonstration(f"{task}_{number}", "", task, (human,), (robot,), *ends)


def session(seed: int, n: int = 6) -> list[Demonstration]:
    rng = np.random.default_rng(seed)
    return [take(rng, task, number) for task in GOALS for number in range(n)]


def of_human(change):
    return lambda one: replace(one, observed=(change(one.observed[0]),))


def of_robot(change):
    return lambda one: replace(one, controlled=(change(one.controlled[0]),))


def valued(change):
    return lambda signal: replace(signal, values=change(signal.values))


def both_backwards(one: Demonstration) -> Demonstration:
    backwards = valued(lambda v: v[::-1])
    return of_human(backwards)(of_robot(backwards)(one))


@pytest.mark.parametrize(
    ("slip", "said"),
    [
        (of_human(valued(lambda v: v * [1, -1, 1])), r"its (x, -y, z) are the others' (x, y, z)"),
        (of_human(valued(lambda v: v[:, [0, 2, 1]])), "its (x, z, y) are"),
        (of_human(valued(lambda v: v[:, [0, 2, 1]] * [1, 1, -1])), "its (x, -z, y) are"),
        (of_human(valued(lambda v: v + [3.0, 0.0, 1.0])), "another frame, 3.2 m away"),
        (of_robot(valued(lambda v: v * [1, -1, 1, 1])), "the other sign of a2"),
        (of_robot(valued(lambda v: v[:, [0, 2, 1, 3]])), "a2 exchanged with a3"),
        (of_robot(valued(lambda v: v + [0, 0, 0, 2.5])), "another zero of a4, 2.5 rad off"),
        (both_backwards, "time that runs backwards"),
        (lambda one: replace(one, task="screw"), "as recordings of plate do"),
        (of_robot(valued(lambda v: v + [0, 2 * np.pi, 0, 0])), None),  # the same posture
    ],
)
def test_a_slip_in_one_recording_of_six_is_named(slip, said):
    recordings = session(4)
    recordings[2] = slip(recordings[2])
    found = stream_doubts([*map(summarise, recordings)])
    assert [doubt.name for doubt in found] == ["plate_2"] * (said is not None)
    assert all(said in doubt.reason for doubt in found)


@pytest.mark.parametrize(
    ("part", "side"), [(slice(0, 55), "ends"), (slice(50, None), "begins"), (slice(None), None)]
)
def test_a_recording_that_was_cut_while_the_hand_moved_is_named(part, side):
    def cut(signal: Signal) -> Signal:
        return replace(signal, stamps_ns=signal.stamps_ns[part], values=signal.values[part])

    recordings = session(5)
    short = of_human(cut)(of_robot(cut)(recordings[2]))
    recordings[2] = replace(
        short, start_ns=int(STAMPS_NS[part][0]), end_ns=int(STAMPS_NS[part][-1])
    )
    found = stream_doubts([*map(summarise, recordings)])
    assert [doubt.name for doubt in found] == ["plate_2"] * (side is not None)
    assert all(f"the recording {side} while" in doubt.reason for doubt in found)


def test_few_good_recordings_are_named():
    """Of 50 sessions without slips, and of a task of which there are too few to compare."""
    found = [stream_doubts([*map(summarise, session(seed))]) for seed in range(50)]
    named = [doubt for doubts in found for doubt in doubts if "lies" in doubt.reason]
    assert len(named) <= 6  # 1 % of 600
    few = session(6, n=4)
    few[0] = of_human(valued(lambda v: v + 3.0))(few[0])
    assert stream_doubts([*map(summarise, few)]) == []


@pytest.mark.parametrize(
    ("data", "named"),
    [("nuisi", {"demo_0001", "demo_0007"}), ("hri_yumi", set()), ("icub_heights", set())],
)
def test_of_real_recordings_the_odd_are_named(shared_data, data, named):
    """Begins at its highest speed; is half a metre from where the others are."""
    folder = shared_data / data
    recordings, _ = read_demonstrations([folder], load_dofs(folder / "dofs.yaml"))
    found = stream_doubts([*map(summarise, recordings)])
    assert {d.name for d in found if "task's other recordings" in d.reason} == named
