# SPDX-License-Identifier: Apache-2.0
"""Whether two libraries hold the same numbers, whatever their provenance."""

from dataclasses import fields, is_dataclass

import numpy as np


def assert_same(found, expected, *, rtol: float, atol: float = 0.0, apart=("provenance",)) -> None:
    """Compare field by field, down to arrays, numbers and texts; some fields are left out."""
    for field in (field.name for field in fields(expected) if field.name not in apart):
        ours, theirs = getattr(expected, field), getattr(found, field)
        _assert_same(theirs, ours, f"{field}", rtol=rtol, atol=atol)


def _assert_same(found, expected, name: str, **tolerance: float) -> None:
    assert type(found) is type(expected), name
    if isinstance(expected, np.ndarray | float):
        np.testing.assert_allclose(found, expected, err_msg=name, **tolerance)
    elif is_dataclass(expected):
        assert_same(found, expected, apart=(), **tolerance)
    elif isinstance(expected, tuple):
        assert len(found) == len(expected), name
        for k, (one, other) in enumerate(zip(found, expected, strict=True)):
            _assert_same(one, other, f"{name}[{k}]", **tolerance)
    else:
        assert found == expected, name
