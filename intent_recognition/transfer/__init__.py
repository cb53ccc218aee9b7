# SPDX-License-Identifier: Apache-2.0
"""Handovers by force: who carries how much, how hard to grip, and when to let go."""

from intent_recognition.transfer.load import LoadEstimator
from intent_recognition.transfer.machine import (
    EXCHANGES,
    PATIENCE_S,
    Holding,
    Request,
    Situation,
    TransferMachine,
    TransferOutput,
)
from intent_recognition.transfer.sharing import FIRM_N, LIGHTEST_N, away_from_base, carrying_grip
