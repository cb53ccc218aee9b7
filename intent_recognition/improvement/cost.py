# SPDX-License-Identifier: Apache-2.0
"""Cost of a rollout: a named cost, or a function in a user's Python file."""

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
"""Name of the module as which a user's file is run."""


@dataclass(frozen=True)
class Rollout:
    """One execution, as a cost function receives it."""

    times_s: Floats  # since the start (T,); for a taught task since the person's onset
    joints_rad: Floats  # joints of the arm (T, n)
    # results by name; for a pour the numbers of balls `balls`, `caught`, `spilled`, `kept` and
    # `wanted`; for a taught task `distance_m` and `late_s`
    outcome: Mapping[str, float]
    # position of the arm's hand (T, 3) [m] in the frame of its base; None for a pour
    hand_m: Floats | None = None
    person_m: Floats | None = None  # position of the person's hand (T, 3) [m]; None for a pour


CostOf: TypeAlias = Callable[[Rollout], float]


@dataclass(frozen=True)
class Cost:
    """A cost function and the name by which it was requested; lower is better.

    `version` identifies the content of a user's file; it is empty for named costs.
    """

    name: str
    of: CostOf
    version: str = ""

    def __call__(self, rollout: Rollout) -> float:
        """The cost of a rollout.

        Raises:
            ArgumentError: the function failed, or did not return a finite number.
        """
        try:
            value = self.of(rollout)
        except Exception as error:  # the user's code may raise anything
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
    """Number of balls spilled, plus the deviation of the second container from the wanted number.

    A spilled ball counts twice, as it is also missing; a ball left in the cup counts once.
    """
    return rollout.outcome["spilled"] + level(rollout)


def level(rollout: Rollout) -> float:
    """Deviation of the number of balls in the second container from the wanted number."""
    return abs(rollout.outcome["wanted"] - rollout.outcome["caught"])


def distance(rollout: Rollout) -> float:
    """Distance of the hand from its goal once both agents have come to rest [m]."""
    return rollout.outcome["distance_m"]


def time(rollout: Rollout) -> float:
    """Time for which the person waits for the hand to reach its goal [s]."""
    return max(rollout.outcome["late_s"], 0.0)


COSTS: Mapping[str, CostOf] = {
    "spilled": spilled,
    "level": level,
    "distance": distance,
    "time": time,
}
"""Costs that have a name."""


def load_cost(name: str, known: Sequence[str] = tuple(COSTS), *, files: bool = True) -> Cost:
    """Load a named cost, or the only public function of a Python file.

    Raises:
        ArgumentError: unknown name, or the file cannot be run or has not exactly one function.
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
    try:
        check_regular(path)
    except (OSError, UntrustedError) as error:
        cure = "Check the path."
        raise ArgumentError.about(f"cost {path}", "a Python file", error, cure) from error
    try:
        return runpy.run_path(str(path), run_name=MODULE)
    except Exception as error:  # the user's code may raise anything
        got, cure = f"{type(error).__name__}: {error}", "Correct the file."
        expected = "a Python file that runs"
        raise ArgumentError.about(f"cost {path}", expected, got, cure) from error
