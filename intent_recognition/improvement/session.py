# SPDX-License-Identifier: Apache-2.0
"""What can be practised, a single try, and practice that is stored in a folder.

    practice.json       what is practised, and each point tried with its cost and outcome
    rollouts/000, ...   the rollouts as bags

The file is replaced atomically after each rollout. Ending the process at any instant loses at most
the current rollout, which is then repeated identically.
"""

import hashlib
import json
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from math import isfinite
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.durable import write_text, writing
from intent_recognition.errors import ModelError, ResourceBusyError
from intent_recognition.improvement.cost import Cost, Rollout
from intent_recognition.improvement.search import Search, SearchSpace, next_point, settled_point
from intent_recognition.untrusted import UntrustedError, load_json, read_text


class Practice(Protocol):
    """A movement that can be practised in simulation."""

    @property
    def costs(self) -> Sequence[str]:
        """Names of suitable costs, the default first."""

    @property
    def step(self) -> float:
        """Initial step of the search, in standard deviations."""

    @property
    def space(self) -> SearchSpace:
        """Space of the weights to search."""

    def keeps_limits(self, weights: Floats) -> bool:
        """Whether the path of weights (d,) can be executed."""

    def rollout(self, weights: Floats, rng: np.random.Generator) -> Sequence[Rollout]:
        """Execute weights once, or once with each of several people."""

    def check(self, weights: Floats, count: int) -> Sequence[Rollout]:
        """Execute weights `count` times, in conditions not used by `rollout` if there are any."""

    def write(self, folder: Path, rollouts: Sequence[Rollout], labels: Mapping[str, str]) -> None:
        """Write rollouts as a bag, or as several bags below the folder."""


class PracticeComparison(NamedTuple):
    """Mean cost and mean outcome of initial and other weights in the same fresh executions."""

    before: float
    after: float
    outcome_before: Mapping[str, float]
    outcome_after: Mapping[str, float]


def compare(practice: Practice, cost: Cost, weights: Floats, count: int) -> PracticeComparison:
    """Compare the initial weights with weights (d,) in `count` fresh executions each."""
    before, after = (practice.check(w, count) for w in (practice.space.mean, weights))
    return PracticeComparison(
        mean_cost(cost, before), mean_cost(cost, after), mean_outcome(before), mean_outcome(after)
    )


def mean_cost(cost: Cost, rollouts: Sequence[Rollout]) -> float:
    """Mean cost of some rollouts."""
    return float(np.mean([cost(one) for one in rollouts]))


def mean_outcome(rollouts: Sequence[Rollout]) -> dict[str, float]:
    """Mean of each outcome of some rollouts."""
    return {
        name: float(np.mean([one.outcome[name] for one in rollouts]))
        for name in rollouts[0].outcome
    }


STATE, ROLLOUTS = "practice.json", "rollouts"
FORMAT = 1
"""Version of the file format; other versions are rejected."""


@dataclass(frozen=True)
class Tried:
    """One rollout: the point (k,) in whitened coordinates, its cost, bag and outcome."""

    point: tuple[float, ...]
    cost: float
    bag: str
    outcome: Mapping[str, float]


class PracticeSession:
    """Practice stored in a folder, which is created if needed; continues from the stored state.

    `about` holds everything else that the result depends on, such as task, containers and seed.

    Raises:
        ResourceBusyError: the folder holds another practice, or cannot be created.
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
        parts = practice.space.mean, practice.space.axes, np.array(practice.space.bound)
        digest = hashlib.sha256(b"".join(part.tobytes() for part in parts)).hexdigest()[:16]
        named = f"{cost.name} {cost.version}".strip()
        self.about = {**about, "cost": named, "primitive": digest}
        self.tried = self._read()

    @property
    def points(self) -> Floats:
        """The points tried (n, k)."""
        size = self._practice.space.n_axes
        return np.array([one.point for one in self.tried], dtype=np.float64).reshape(-1, size)

    @property
    def costs(self) -> Floats:
        """Costs of the points tried (n,)."""
        return np.array([one.cost for one in self.tried], dtype=np.float64)

    def step(self) -> Tried:
        """Execute the next rollout, record it, and store its cost.

        Raises:
            ArgumentError: the cost function failed, or the primitive's mean breaks the limits.
            BagError, ResourceBusyError: the bag cannot be written.
        """
        number, practice = len(self.tried), self._practice
        rng = np.random.default_rng([int(self.about["seed"]), number])
        point = self.next()
        rollouts = practice.rollout(practice.space.weights(point), rng)
        cost = mean_cost(self._cost, rollouts)
        bag = self.folder / ROLLOUTS / f"{number:03d}"
        if bag.exists():
            shutil.rmtree(bag)  # of a process that was ended before it was kept
        practice.write(bag, rollouts, {"rollout": str(number), "cost": f"{cost:.6g}"})
        name = bag.relative_to(self.folder).as_posix()
        return self.keep(point, cost, name, mean_outcome(rollouts))

    def next(self) -> Floats:
        """Next point to try (k,)."""
        practice = self._practice
        tried = self.points, self.costs
        return next_point(self._search, practice.space, *tried, practice.keeps_limits)

    def keep(self, point: Floats, cost: float, bag: str, outcome: Mapping[str, float]) -> Tried:
        """Store the result of a point on disk.

        Raises:
            ResourceBusyError: the file cannot be written.
        """
        tried = Tried(tuple(point.tolist()), cost, bag, dict(outcome))
        every, path = [*self.tried, tried], self.folder / STATE
        content = {"format": FORMAT, "about": self.about, "tried": [asdict(one) for one in every]}
        with writing(str(path)):
            write_text(path, json.dumps(content, indent=1) + "\n")
        self.tried = every
        return tried

    def settled(self) -> Floats:
        """Improved weights (d,) that practice found.

        Raises:
            ModelError: nothing was tried, or nothing is better than the initial weights.
        """
        if not self.tried:
            cure = "Practise first."
            raise ModelError.about(str(self.folder), "rollouts", "none", cure)
        if not self.improved:
            got, cure = f"none after {len(self.tried)} rollouts", "Practise on."
            raise ModelError.about(str(self.folder), "a better path than the first", got, cure)
        return self.best()

    @property
    def improved(self) -> bool:
        """Whether practice found something better than the initial weights."""
        return not np.array_equal(self.best(), self._practice.space.mean)

    def best(self) -> Floats:
        """Improved weights (d,), or the initial weights if there is no improvement."""
        space, keeps = self._practice.space, self._practice.keeps_limits
        return space.weights(settled_point(self._search, space, self.points, self.costs, keeps))

    def _read(self) -> list[Tried]:
        path, cure = self.folder / STATE, "Choose another folder."
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            text = read_text(path, 100_000_000) if path.exists() else ""
            if not text:
                return []
            content = load_json(text)
            about, known = dict(content["about"]), content["format"] == FORMAT
            tried = [
                Tried(tuple(map(float, t["point"])), float(t["cost"]), t["bag"], {**t["outcome"]})
                for t in content["tried"]
            ]
            n_axes = self._practice.space.n_axes
            whole = all(len(t.point) == n_axes and isfinite(sum(t.point, t.cost)) for t in tried)
            if known and about == self.about and not whole:
                raise ValueError(f"a rollout other than {n_axes} coordinates and a cost")
        except OSError as error:
            expected = "a folder that can be made and read"
            raise ResourceBusyError.about(str(self.folder), expected, error, cure) from error
        except (UntrustedError, KeyError, TypeError, ValueError) as error:
            raise ModelError.about(str(path), "a file of practice", error, cure) from error
        if not known or about != self.about:
            differ = {k: v for k, v in about.items() if v != self.about.get(k)}
            begun = [f"{key} {value}" for key, value in differ.items() if key != "primitive"]
            cure = "Give what it was begun with, or choose another folder (--output)."
            with_what = ", ".join(begun) or "another primitive"
            got = f"practice begun with {with_what}" if known else "a file of another version"
            raise ResourceBusyError.about(str(self.folder), "the same practice", got, cure)
        return tried
