# SPDX-License-Identifier: Apache-2.0
"""What must be known to read the numbers of an evaluation, as sentences."""

from collections.abc import Mapping
from math import log

SEGMENTS = {
    "recording": "Shares observed are of the recording, with any rest before the movement;"
    " --segment movement gives shares of the movement, as at the online decision.",
    "movement": "Shares observed are of the movement, as at the online decision.",
}
CHANCE = (
    "Chance, which knows the number of tasks alone, has an accuracy of {share:.2f} and a log loss"
    " of {loss:.2f}. Early figures can be worse: where tasks begin alike, the recording that is"
    " left out is missing from its own task alone, whose mean is then farther from it than others."
)
ONE_TASK = "With one task there is nothing to recognise: its accuracy and log loss say nothing."


def remarks_on(result: Mapping) -> list[str]:
    """Sentences to stand beside the tables of `evaluate`: what the shares are of, and limits."""
    lines = [SEGMENTS[result.get("segment", "movement")]]
    n_tasks = len(result.get("tasks", ()))
    if n_tasks < 2:
        return [*lines, ONE_TASK] if n_tasks else lines
    return [*lines, CHANCE.format(share=1.0 / n_tasks, loss=log(n_tasks))]
