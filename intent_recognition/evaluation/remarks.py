# SPDX-License-Identifier: Apache-2.0
"""What must be known to read the numbers of an evaluation, as sentences."""

from collections.abc import Mapping

SEGMENTS = {
    "recording": "Shares observed are of the recording, with any rest before the movement;"
    " --segment movement gives shares of the movement, as at the online decision.",
    "movement": "Shares observed are of the movement, as at the online decision.",
}
ONE_TASK = "With one task there is nothing to recognise: its accuracy and log loss say nothing."


def remarks_on(result: Mapping) -> list[str]:
    """Sentences to stand beside the tables of `evaluate`: what the shares are of, and limits."""
    lines = [SEGMENTS[result.get("segment", "movement")]]
    return [*lines, ONE_TASK] if len(result.get("tasks", ())) == 1 else lines
