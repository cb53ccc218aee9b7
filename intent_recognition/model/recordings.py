# SPDX-License-Identifier: Apache-2.0
"""What the recordings in a folder of tasks are good for."""

from pathlib import Path

from intent_recognition.bags import BagReader
from intent_recognition.demonstrations import CORRECTED
from intent_recognition.errors import BagError, TrainingError
from intent_recognition.model.from_bags import FromBags


def is_correction(bag: Path) -> bool:
    """Whether a recording is a corrected execution."""
    return CORRECTED in BagReader(bag, tolerant=True).custom_data


def is_finished(bag: Path) -> bool:
    """Whether a recording was closed."""
    try:
        return BagReader(bag, tolerant=True).is_finished
    except BagError:
        return False


def check_usable(found: FromBags, bag: Path) -> None:
    """Say why nothing of a recording can be used."""
    if found.accumulated.n_used:
        return
    reasons = [str(r) for r in found.rejections] + [r for _, r in found.accumulated.rejected]
    raise TrainingError.about(
        bag.name,
        "a recording of one movement, at rest before and after",
        "; ".join(reasons[:3]) or "nothing",
        "Record it again; this one is kept in `undone`.",
    )
