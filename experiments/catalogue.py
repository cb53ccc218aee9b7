# SPDX-License-Identifier: Apache-2.0
"""The experiments by name, in the order of the papers."""

import importlib
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from experiments.settings import Settings
from intent_recognition.errors import ArgumentError

if TYPE_CHECKING:
    from experiments.results import ExperimentResult


@dataclass(frozen=True)
class Experiment:
    """One experiment: its name, the module that holds `run(settings)`, and what it regenerates."""

    name: str
    module: str
    source: str
    summary: str

    def run(self, settings: Settings) -> "ExperimentResult":
        """Run the experiment."""
        return importlib.import_module(self.module).run(settings)


IP, MIP, WP = "Maeda et al. 2014", "Ewerton et al. 2015", "Brandl et al. 2014"
EXPERIMENTS = tuple(
    Experiment(name, f"experiments.{name}.experiment", source, summary)
    for name, source, summary in (
        ("sparse", f"{IP}, Fig. 2", "conditioning on few, asynchronous, noisy observations"),
        ("noise", f"{IP}, Fig. 3", "prediction error of ProMP and DMP under noise"),
        ("alignment", f"{IP}, Sec. III-E", "smooth time warps beside dynamic time warping"),
        ("pointing", f"{IP}, Fig. 4-6", "the arm points where the human points"),
        ("assembly", f"{IP}, Fig. 7-9", "two humans assemble a box; the arm takes one's place"),
        ("pole", f"{MIP}, Fig. 2-4", "two ways around a pole, from unlabelled demonstrations"),
        ("toolbox", f"{MIP}, Fig. 5-8", "three tasks from unlabelled demonstrations"),
        (
            "feedback",
            f"{MIP}, Sec. V (future work)",
            "the arm reproduces mean and variance of a primitive",
        ),
        ("change_of_mind", "no paper", "reaches whose goal changes, and movements without a pause"),
        ("context", "no paper", "handovers at a box that is moved, and where it stands is known"),
        ("clearance", "no paper", "boxes in the arm's way: bent, refused, never touched"),
        ("skills", "no paper", "skills that grow: corrected by hand, practised"),
        ("constraints", f"{WP}, Fig. 3", "when a cup pours and where it spills, from other cups"),
        ("grasps", "no paper", "the mug's grasp lifts other cups and bowls"),
        ("pouring", f"{WP}, Fig. 4-5", "the arm pours with containers never demonstrated"),
    )
)
"""The experiments, in the order of the papers."""


def chosen(names: Iterable[str]) -> list[Experiment]:
    """The experiments of these names, each once, in the order of the papers; all without names.

    Raises:
        ArgumentError: a name is not in the catalogue.
    """
    known = {entry.name: entry for entry in EXPERIMENTS}
    wanted = list(names) or list(known)
    for name in wanted:
        if name not in known:
            cure = "`intent experiments --list` shows all."
            raise ArgumentError.about("NAME", f"one of {', '.join(known)}", name, cure)
    return [entry for entry in EXPERIMENTS if entry.name in wanted]
