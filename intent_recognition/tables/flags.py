# SPDX-License-Identifier: Apache-2.0
"""Columns that say when a body was seen, such as `wrist_valid` and `occluded`."""

import re
from collections.abc import Mapping, Sequence

import numpy as np

from intent_recognition.array_types import Flags
from intent_recognition.tables.cells import Values, texts

FLAG = re.compile(
    r"(?i)(?P<body>|.*?[\W_]|(?-i:.*[a-z\d](?=[A-Z])))(?:is[\W_]?)?(?:tracking[\W_]?)?"
    r"(?:(?P<seen>valid|visible|tracked|seen|detected)"
    r"|(?P<hidden>occluded|occlusion|hidden|lost|invalid|missing|untracked))"
)
"""Names of such columns, after that of their body if they are of one."""
TRUE, FALSE = ("1", "true", "t", "yes", "y"), ("0", "false", "f", "no", "n", "")
"""Texts of the two values in lower case; an empty cell was not seen, or not hidden."""
PLACE_END = re.compile(
    r"(?i)(?:(?:^|[\W_]+)(?:pos(?:ition)?|pose|loc(?:ation)?|trans(?:lation)?|orientation"
    r"|rot(?:ation)?|quat(?:ernion)?|xyz|[opqrt]?[wxyz]|\d|\[.*\]|\(.*\)|[mcd]?m|in|ft)"
    r"|(?-i:(?<=[a-z\d])(?:Pos(?:ition)?|Rot(?:ation)?|Quat(?:ernion)?|[WXYZ])))+[\W_]*$"
)
"""Ends of names of a body's columns."""


def flags_of(names: Sequence[str], column: str) -> list[str]:
    """Names of the columns that say when the body of a column was seen."""
    bodies = {"", _plain(PLACE_END.sub("", column))}
    found = ((name, match) for name in names if (match := FLAG.fullmatch(name)))
    return [n for n, match in found if _plain(match["body"]) in bodies and names.count(n) == 1]


def seen_rows(flags: Mapping[str, Values], rows: int) -> Flags:
    """Rows (T,) in which a body was seen; all if no flag is of this length, or none were."""
    seen = np.ones(rows, bool)
    for name, cells in flags.items():
        said = texts(cells)
        plain = {text: re.sub(r"\.0+$", "", text.lower()) for text in {*said}}
        if len(said) == rows and {*plain.values()} <= {*TRUE, *FALSE}:  # no share or number
            match = FLAG.fullmatch(name)
            is_true = np.array([plain[text] in TRUE for text in said], bool)
            seen &= is_true == bool(match and match["seen"])
    return seen if seen.any() else np.ones(rows, bool)


def _plain(body: str) -> str:
    return re.sub(r"[\W_]+", "", body).lower()
