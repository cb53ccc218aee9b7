# SPDX-License-Identifier: Apache-2.0
"""What an experiment depends on."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from intent_recognition.share import share_path


def _silent(share: float, what: str) -> None:
    """Report no progress."""


@dataclass(frozen=True)
class Settings:
    """What an experiment depends on, and nothing else.

    Attributes:
        seed: of everything random; the same seed gives the same numbers on the same machine.
        n_seeds: number of draws of the recordings, where an experiment shows their spread: the
            shipped ones, and those of the seeds after `seed`.
        quick: a fast subset that takes every path, for tests and for a first look.
        bags: folder of the recordings; None takes the shipped ones.
        progress: called with the share done (0 to 1) and what is being done.
    """

    seed: int = 1
    n_seeds: int = 3
    quick: bool = False
    bags: Path | None = None
    progress: Callable[[float, str], None] = field(default=_silent, compare=False)

    def part(self, begin: float, end: float, prefix: str = "") -> "Settings":
        """The same with the progress of a part, from one share of the whole to another."""

        def progress(share: float, what: str) -> None:
            self.progress(begin + (end - begin) * share, prefix + what)

        return replace(self, progress=progress)

    def rng(self, stream: int) -> np.random.Generator:
        """An independent random generator for one purpose of the experiment."""
        return np.random.default_rng([self.seed, stream])

    def recordings(self, scenario: str) -> Path:
        """Folder of a scenario's recordings, such as "pole" or "toolbox/train".

        Raises:
            IntentError: they are not shipped with this installation.
        """
        return share_path(f"bags/{scenario}") if self.bags is None else self.bags / scenario
