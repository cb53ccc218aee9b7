# SPDX-License-Identifier: Apache-2.0
"""Results of an experiment: findings beside the paper's figures, blocks, numbers."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from intent_recognition.errors import ArgumentError
from intent_recognition.report import Block


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
            raise ArgumentError.about("remark", "the reason", "nothing", cure)

    @classmethod
    def wanted(
        cls, quantity: str, paper: str, ours: str, holds: bool | np.bool_, missed: str
    ) -> "Finding":
        """A figure that is to be met; `missed` is its remark where it is not."""
        return cls(quantity, paper, ours, bool(holds), "" if holds else missed)

    @classmethod
    def alone(cls, quantity: str, ours: str, remark: str) -> "Finding":
        """A figure of ours for which the paper has none; `remark` says so."""
        return cls(quantity, "", ours, None, remark)


class ExperimentPart(NamedTuple):
    """What one of several parts adds to the result of an experiment; see `ExperimentResult`."""

    findings: tuple[Finding, ...]
    blocks: tuple[Block, ...]
    conditions: tuple[str, ...]
    numbers: Mapping[str, object]


@dataclass(frozen=True)
class ExperimentResult:
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
