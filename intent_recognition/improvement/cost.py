# SPDX-License-Identifier: Apache-2.0
"""What a rollout costs: by name, or by a Python file of the user's."""

import hashlib
import inspect
import math
import runpy
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError, number
from intent_recognition.untrusted import UntrustedError, check_regular

MODULE = "cost_of_practice"
"""Name of the module that a file of the user's is run as."""


@dataclass(frozen=True)
class Rollout:
    """One execution, as a cost sees it."""

    times_s: Floats  # since the start (T,); of a taught task since the person's onset
    joints_rad: Floats  # of the arm (T, n)
    # what came of it, by name; of a pour `balls`, `caught`, `spilled`, `kept` and `wanted`, each a
    # number of balls; of a taught task `distance_m` and `late_s`
    outcome: Mapping[str, float]
    # where the arm's hand was (T, 3) [m], in the frame of its base; None of a pour
    hand_m: Floats | None = None
    person_m: Floats | None = None  # where the person's hand was (T, 3) [m]; None of a pour


CostOf: TypeAlias = Callable[[Rollout], float]


@dataclass(frozen=True)
class Cost:
    """A cost, by the name it was asked for; lower is better.

    Its version tells one content of a user's file from another; empty for the others.
    """

    name: str
    of: CostOf
    version: str = ""

    def __call__(self, rollout: Rollout) -> float:
        """The cost of a rollout.

        Raises:
            ArgumentError: the function failed, or returned no finite number.
        """
        try:
            value = self.of(rollout)
        except Exception as error:  # the user's own code may raise anything
            where = traceback.extract_tb(error.__traceback__)[-1]
            got = f"{type(error).__name__}: {error} (line {where.lineno} of {where.filename})"
            cure = "Correct the function; the rollouts so far are kept."
            expected = "a function that returns a number"
            raise ArgumentError.about(f"cost {self.name}", expected, got, cure) from error
        if not math.isfinite(number(value)):
            cure = "Return one float; lower is better."
            raise ArgumentError.about(f"cost {self.name}", "a finite number", repr(value), cure)
        return float(value)


def spilled(rollout: Rollout) -> float:
    """Balls that fell beside, and balls more or fewer than wanted in the second container.

    One that is spilled is also missing: it counts twice, one left in the cup once.
    """
    return rollout.outcome["spilled"] + level(rollout)


def level(rollout: Rollout) -> float:
    """Balls more or fewer than wanted in the second container."""
    return abs(rollout.outcome["wanted"] - rollout.outcome["caught"])


def distance(rollout: Rollout) -> float:
    """How far the hand is from where it must be, once both agents have come to rest [m]."""
    return rollout.outcome["distance_m"]


def time(rollout: Rollout) -> float:
    """How long the person waits for the hand to be where it must be [s]."""
    return max(rollout.outcome["late_s"], 0.0)


COSTS: Mapping[str, CostOf] = {
    "spilled": spilled,
    "level": level,
    "distance": distance,
    "time": time,
}
"""The costs that have a name."""


def load_cost(name: str, known: Sequence[str] = tuple(COSTS), *, files: bool = True) -> Cost:
    """The cost of a name, or of the one public function in a Python file.

    Raises:
        ArgumentError: no such cost is known, or the file cannot be run or has not one function.
    """
    if name in known:
        return Cost(name, COSTS[name])
    path = Path(name)
    if not files or path.suffix != ".py":
        expected = f"one of {', '.join(known)}" + (", or a Python file" if files else "")
        raise ArgumentError.about("cost", expected, name, "Correct the name or the path.")
    own = [
        found
        for key, found in _run(path).items()
        if inspect.isfunction(found) and found.__module__ == MODULE and key[0] != "_"
    ]
    if len(own) != 1:
        got = ", ".join(function.__name__ for function in own) or "none"
        cure = "Begin the names of helpers with an underscore."
        raise ArgumentError.about(f"cost {name}", "one function in the file", got, cure)
    return Cost(path.name, own[0], hashlib.sha256(path.read_bytes()).hexdigest()[:16])


def _run(path: Path) -> dict[str, Any]:
    """What the file defines, by name."""
    try:
        check_regular(path)
    except (OSError, UntrustedError) as error:
        cure = "Check the path."
        raise ArgumentError.about(f"cost {path}", "a Python file", error, cure) from error
    try:
        return runpy.run_path(str(path), run_name=MODULE)
    except Exception as error:  # the user's own code may raise anything
        got, cure = f"{type(error).__name__}: {error}", "Correct the file."
        expected = "a Python file that runs"
        raise ArgumentError.about(f"cost {path}", expected, got, cure) from error
