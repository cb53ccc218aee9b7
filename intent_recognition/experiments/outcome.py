# SPDX-License-Identifier: Apache-2.0
"""What goes into an experiment, and what comes out of it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from intent_recognition.errors import ArgumentError, describe
from intent_recognition.report import Block
from intent_recognition.share import share_path


def _silent(share: float, what: str) -> None:
    """Nobody watches."""


@dataclass(frozen=True)
class Settings:
    """What an experiment depends on, and nothing else.

    Attributes:
        seed: of everything random; the same seed gives the same numbers on the same machine.
        quick: a fast subset that takes every path, for tests and for a first look.
        bags: folder of the recordings; None takes the shipped ones.
        progress: called with the share done (0 to 1) and what is going on.
    """

    seed: int = 1
    quick: bool = False
    bags: Path | None = None
    progress: Callable[[float, str], None] = field(default=_silent, compare=False)

    def rng(self, stream: int) -> np.random.Generator:
        """An independent random generator for one purpose of the experiment."""
        return np.random.default_rng([self.seed, stream])

    def recordings(self, scenario: str) -> Path:
        """Folder of a scenario's recordings, such as "pole" or "toolbox/train".

        Raises:
            IntentError: they are not shipped with this installation.
        """
        return share_path(f"bags/{scenario}") if self.bags is None else self.bags / scenario


@dataclass(frozen=True)
class Finding:
    """One figure of the paper and ours.

    Attributes:
        quantity: what is compared, with its unit.
        paper: the paper's figure; empty where it gives none.
        ours: our figure.
        holds: True where ours meets or beats the paper's, False where it does not, None where the
            two are not like for like.
        remark: one sentence; required unless `holds` is True.
    """

    quantity: str
    paper: str
    ours: str
    holds: bool | None
    remark: str = ""

    def __post_init__(self) -> None:
        """Ask for the reason where the paper's figure is not met."""
        if self.holds is not True and not self.remark:
            cure = "Say in one sentence why."
            raise ArgumentError(describe("remark", "the reason", "nothing", cure))


@dataclass(frozen=True)
class Outcome:
    """Numbers and figures of one experiment.

    Attributes:
        title: what it is about.
        source: the paper's figure or table, such as "Maeda et al. 2014, Fig. 4-6".
        question: one or two sentences: what is asked.
        findings: paper and ours, side by side.
        blocks: figures, tables and remarks for the report.
        conditions: what differs from the paper, one sentence each.
        numbers: everything a script would want, ready for JSON.
    """

    title: str
    source: str
    question: str
    findings: tuple[Finding, ...]
    blocks: tuple[Block, ...]
    conditions: tuple[str, ...]
    numbers: Mapping[str, object]
