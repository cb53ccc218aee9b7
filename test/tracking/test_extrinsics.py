# SPDX-License-Identifier: Apache-2.0
"""Extrinsics as texts: read as they are written, and what is none is named."""

import numpy as np
import pytest

from intent_recognition.errors import ArgumentError
from intent_recognition.tracking import parse_extrinsics


@pytest.mark.parametrize(
    "entry",
    [
        "cam 1 2 3", "cam 0 0 0 0 0 0 x", "0 0 0 0 0 0 1", "cam 0 0 0 0 0 0 1 1",
        "cam 0 0 0 0 0 0 0", "cam nan 0 0 0 0 0 1", "/first 0 0 0 0 0 0 1",
    ],
)  # fmt: skip
def test_malformed_entries_are_refused_by_number(entry):
    with pytest.raises(ArgumentError, match=r"^file: extrinsics\[1\]: expected one 'frame") as info:
        parse_extrinsics(["first 0 0 0 0 0 0 1", entry], "file: extrinsics")
    assert repr(entry) in str(info.value) and "Give each frame once" in str(info.value)


def test_entries_are_read():
    parsed = parse_extrinsics(["cam 1 2 3 0 0 0 1", ""])
    assert list(parsed) == ["cam"]
    np.testing.assert_array_equal(parsed["cam"][0], [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(parsed["cam"][1], [0.0, 0.0, 0.0, 1.0])
