# SPDX-License-Identifier: Apache-2.0
"""All benchmarks in their order, those that a clock decides first."""

import time
from collections.abc import Iterator

from benchmarks.alignment import alignment
from benchmarks.bank import bank
from benchmarks.bank_memory import growth, long_run, memory
from benchmarks.bank_numerics import numerics, one_movement
from benchmarks.clearance import clearance
from benchmarks.flood import flood
from benchmarks.kinematics import kinematics
from benchmarks.measure import Result
from benchmarks.mixture import mixture
from benchmarks.node import node
from benchmarks.offline import bags_to_model, evaluation
from benchmarks.online import online
from benchmarks.page import page
from benchmarks.pouring import pouring
from benchmarks.reading import reading
from benchmarks.recognition import unknown_tasks
from benchmarks.soak import soak
from benchmarks.training import training
from benchmarks.transfer import transfer
from benchmarks.warping import warping
from intent_recognition.demonstrations import load_dofs, read_demonstrations
from intent_recognition.share import share_path

TRAINING = "bags/toolbox/train"
HELD_OUT = "bags/toolbox/test"
FEW_TRANSFERS = 18
"""Each kind of disturbance with each object; `python -m benchmarks.transfer` does more."""


def everything(minutes: float, soak_minutes: float) -> Iterator[str | Result]:
    """Headings, and the results that belong to them as they are measured.

    The million observations of the last one end early when so many minutes are over, without those
    in which the graph works on end.
    """
    end_s = time.monotonic() + 60.0 * minutes
    in_parts, library, demonstrations = bags_to_model(share_path(TRAINING))
    held_out, _ = read_demonstrations(share_path(HELD_OUT), load_dofs())
    recorded = held_out[0]
    yield "One observation: time of the filter bank"
    yield from bank()
    yield "Nodes, from a pose to a trajectory of 50 points and 7 joints"
    yield from node(library, held_out)
    yield from page(library)
    yield "Staying up"
    yield from flood(library)
    yield from soak(library, soak_minutes)
    end_s += 60.0 * soak_minutes
    yield "Learning from aligned demonstrations"
    yield from training(demonstrations)
    yield "Alignment in time"
    yield from alignment()
    yield "Mixture from unlabelled demonstrations"
    yield from mixture(demonstrations)
    yield "Inverse kinematics of any arm"
    yield from kinematics()
    yield "Clear of boxes and of the arm itself"
    yield from clearance(library)
    yield "Handing over"
    yield from transfer(FEW_TRANSFERS)
    yield "Warping"
    yield from warping()
    yield "Pouring"
    yield from pouring()
    yield "Reading bags"
    yield from reading()
    yield "As a whole"
    yield in_parts
    yield evaluation(demonstrations)
    yield from online(library, recorded)
    with long_run(end_s - time.monotonic()) as process:
        yield "Numerics"
        yield from numerics()
        yield from one_movement()
        yield "Movements of unknown tasks"
        yield from unknown_tasks(demonstrations)
        yield "Memory"
        yield memory()
        yield growth(process)
