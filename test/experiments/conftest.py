# SPDX-License-Identifier: Apache-2.0
"""What tests of several experiments need."""

from collections.abc import Iterator

import pytest

from experiments import generate
from intent_recognition.share import share_path


@pytest.fixture(autouse=True, scope="module")
def rough(laid_out_roughly) -> None:
    """Of the figures of experiments only their content is looked at."""


@pytest.fixture(scope="module")
def shipped_again() -> Iterator[None]:
    """Recordings that are drawn again are the shipped ones: nothing is simulated."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(generate, "record", link_shipped)
        yield


def link_shipped(output, seed, scenario, keep):
    """In place of the simulation: the recordings of seed 1 that are wanted, whatever the seed."""
    for bag in share_path(f"bags/{scenario}").rglob("metadata.yaml"):
        place = bag.parent.relative_to(share_path("bags"))
        if keep(place):
            (output / place).parent.mkdir(parents=True, exist_ok=True)
            (output / place).symlink_to(bag.parent)
