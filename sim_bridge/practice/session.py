# SPDX-License-Identifier: Apache-2.0
"""A folder of practice: every rollout as a bag, and a file that says what was tried.

    practice.json       what is practised, and each point tried with its cost and outcome
    rollouts/000, ...   the rollouts as bags
    start.npz           the skill it began with
    skill.npz           what was accepted; not there before

The file is written to the disk and renamed after each rollout. Whoever ends the process at any
instant loses at most the rollout under way, which is made again, alike.
"""

import hashlib
import json
import shutil
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from intent_recognition.durable import write_text
from intent_recognition.errors import ModelError, ResourceBusyError, describe
from intent_recognition.improvement import Search, SearchSpace, next_point, settled_point
from intent_recognition.untrusted import UntrustedError, load_json, read_text
from sim_bridge.practice.cost import Cost, Rollout

STATE, ROLLOUTS = "practice.json", "rollouts"
MOST_TEXT = 100_000_000
"""Bytes of the file. Convention: a hundred thousand rollouts."""
FORMAT = 1
"""Version of the file; another one is not read."""


class Practice(Protocol):
    """What can be practised."""

    @property
    def space(self) -> SearchSpace:
        """Where to look."""

    def keeps_limits(self, weights: NDArray[np.float64]) -> bool:
        """Whether a path of these weights (d,) can be executed."""

    def rollout(self, weights: NDArray[np.float64], rng: np.random.Generator) -> Rollout:
        """Execute it once."""

    def write(self, folder: Path, rollout: Rollout, labels: Mapping[str, str]) -> None:
        """Write a rollout as a bag."""


@dataclass(frozen=True)
class Tried:
    """One rollout: the point (k) in whitened coordinates, its cost, its bag and what came of it."""

    point: tuple[float, ...]
    cost: float
    bag: str
    outcome: Mapping[str, float]


class PracticeSession:
    """Practice that is kept in a folder and goes on from there.

    Args:
        folder: made if it is missing.
        practice: what is practised.
        search: how to look.
        cost: of a rollout.
        about: what else the result depends on, such as task, containers and seed.

    Raises:
        ResourceBusyError: the folder holds another practice, or cannot be made.
        ModelError: its file is damaged.
    """

    def __init__(
        self,
        folder: Path,
        practice: Practice,
        search: Search,
        cost: Cost,
        about: Mapping[str, str | int],
    ) -> None:
        self.folder, self._practice, self._search, self._cost = folder, practice, search, cost
        self.about = {
            **about,
            "cost": f"{cost.name} {cost.version}".strip(),
            "primitive": _digest(practice.space),
        }
        self.tried = self._read()

    @property
    def points(self) -> NDArray[np.float64]:
        """The points tried (n, k)."""
        size = self._practice.space.n_axes
        return np.array([one.point for one in self.tried], dtype=np.float64).reshape(-1, size)

    @property
    def costs(self) -> NDArray[np.float64]:
        """Their costs (n,)."""
        return np.array([one.cost for one in self.tried], dtype=np.float64)

    def step(self) -> Tried:
        """Execute the next rollout, log it, and keep what it cost.

        Raises:
            ArgumentError: the cost function failed, or the primitive's mean breaks the limits.
            ResourceBusyError: the bag cannot be written.
        """
        space, number = self._practice.space, len(self.tried)
        keeps = self._practice.keeps_limits
        point = next_point(self._search, space, self.points, self.costs, keeps)
        rng = np.random.default_rng([int(self.about["seed"]), number])
        rollout = self._practice.rollout(space.weights(point), rng)
        cost = self._cost(rollout)
        bag = self.folder / ROLLOUTS / f"{number:03d}"
        if bag.exists():
            shutil.rmtree(bag)  # of a process that was ended before it was kept
        self._practice.write(bag, rollout, {"rollout": str(number), "cost": f"{cost:.6g}"})
        name = bag.relative_to(self.folder).as_posix()
        tried = Tried(tuple(point.tolist()), cost, name, dict(rollout.outcome))
        self._keep([*self.tried, tried])
        return tried

    def settled(self) -> NDArray[np.float64]:
        """Weights (d,) that practice has come to."""
        space, keeps = self._practice.space, self._practice.keeps_limits
        return space.weights(settled_point(self._search, space, self.points, self.costs, keeps))

    def _keep(self, tried: list[Tried]) -> None:
        content = {"format": FORMAT, "about": self.about, "tried": [asdict(one) for one in tried]}
        write_text(self.folder / STATE, json.dumps(content, indent=1) + "\n")
        self.tried = tried

    def _read(self) -> list[Tried]:
        path = self.folder / STATE
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            text = read_text(path, MOST_TEXT) if path.exists() else ""
        except OSError as error:
            cure = "Choose another folder."
            expected = "a folder that can be made and read"
            raise ResourceBusyError(describe(str(self.folder), expected, error, cure)) from error
        except UntrustedError as error:
            cure = "Choose another folder."
            raise ModelError(describe(str(path), "a file of practice", error, cure)) from error
        if not text:
            return []
        try:
            content = load_json(text)
            about, known = dict(content["about"]), content["format"] == FORMAT
            tried = [
                Tried(tuple(map(float, t["point"])), float(t["cost"]), t["bag"], t["outcome"])
                for t in content["tried"]
            ]
        except (UntrustedError, KeyError, TypeError, ValueError) as error:
            cure = "Choose another folder."
            raise ModelError(describe(str(path), "a file of practice", error, cure)) from error
        if not known or about != self.about:
            other = [k for k in self.about if not known or about.get(k) != self.about[k]]
            cure = "Go on with what it was begun with, or choose another --output."
            got = f"practice with another {', '.join(other) or 'format'}"
            raise ResourceBusyError(describe(str(self.folder), "the same practice", got, cure))
        return tried


def _digest(space: SearchSpace) -> str:
    """What tells one primitive from another."""
    parts = (space.mean, space.axes, np.array(space.bound))
    return hashlib.sha256(b"".join(part.tobytes() for part in parts)).hexdigest()[:16]
