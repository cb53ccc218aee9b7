# SPDX-License-Identifier: Apache-2.0
"""The part of the experiment on skills that one way of learning adds."""

from collections.abc import Mapping
from typing import NamedTuple

from experiments.results import Finding
from intent_recognition.report import Block


class SkillPart(NamedTuple):
    """The rows, blocks and numbers of one way."""

    findings: tuple[Finding, ...]
    blocks: tuple[Block, ...]
    conditions: tuple[str, ...]
    numbers: Mapping[str, object]
