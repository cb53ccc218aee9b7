# SPDX-License-Identifier: Apache-2.0
"""Learning with few basis functions, a third of the time: tests look at no finer data."""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from intent_recognition.learning import TrainingSettings

FEW = 10
USUAL = TrainingSettings.n_aligned_basis


@contextmanager
def aligned_basis(number: int = FEW) -> Iterator[None]:
    """`TrainingSettings()` has so many basis functions per DOF of an aligned primitive."""
    usual = {name: field.default for name, field in TrainingSettings.__dataclass_fields__.items()}
    defaults = tuple((usual | {"n_aligned_basis": number}).values())
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(TrainingSettings.__init__, "__defaults__", defaults)
        patch.setattr(TrainingSettings, "n_aligned_basis", number)
        yield
