# SPDX-License-Identifier: Apache-2.0
"""The shipped demonstrations are hard: where the wrist is does not say what it is up to."""

import pytest

from intent_recognition.demonstrations import read_demonstrations
from intent_recognition.demonstrations.dofs import load_dofs
from intent_recognition.experiments.toolbox.hardness import compare, compare_folds


@pytest.fixture(scope="module")
def bags(repository):
    return {
        name: read_demonstrations(repository / "bags/toolbox" / name, load_dofs())[0]
        for name in ("train", "test")
    }


@pytest.mark.slow
@pytest.mark.usefixtures("few_basis_functions")
def test_a_shortcut_on_the_position_fails_where_the_library_does_not(bags):
    for accuracy in (compare(bags["train"], bags["test"]), compare_folds(bags["train"], 2, 0.3)):
        assert accuracy.shortcut <= 0.85
        assert accuracy.library >= accuracy.shortcut + 0.10
        assert accuracy.library >= 0.95
