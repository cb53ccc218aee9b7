# SPDX-License-Identifier: Apache-2.0
"""Cells of a column of texts are read as numbers together."""

import re
from pathlib import Path

import numpy as np
import pytest

from intent_recognition.errors import BagError
from intent_recognition.tables.cells import numbers, texts
from intent_recognition.tables.table import Table


@pytest.mark.parametrize(
    ("cells", "expected"),
    [
        ("999.5 1,000 1,000.5", [999.5, 1000.0, 1000.5]),
        ("999,5 1.000 -1.000,5 1.000.000", [999.5, 1000.0, -1000.5, 1e6]),
        ("205.000 1,205.000", [205.0, 1205.0]),
        ("205,000 1.205,000 1.000", [205.0, 1205.0, 1000.0]),
        ("999 1,000 1,000,000", [999.0, 1000.0, 1e6]),
        ("0,5 1,000", [0.5, 1.0]),
        ("0,5 1,000 0.25", [0.5, 1.0, 0.25]),
        ("1.234 2.345 999", [1.234, 2.345, 999.0]),
        ("1,000 1,125 1.#IND -Inf", [1.0, 1.125, np.nan, np.nan]),
        ("1.5 ?", "got '?' in row 2. Name a column of numbers in the map; leave empty what"),
        ("1,000 999", "'1,000' beside '999': thousands?"),
        ("1,000 999.125", "'1,000' beside '999.125': thousands?"),
        ("999.5 1,000", "'1,000' beside '999.5': thousands?"),
        ("1.234 2.345 3,5", "one decimal mark, got '1.234' beside '3,5': thousands?"),
    ],
)
def test_the_cells_of_a_column_say_what_a_mark_means(cells, expected):
    column = np.array(cells.split(), object)
    if isinstance(expected, str):
        with pytest.raises(BagError, match=re.escape(expected)):
            numbers(column, Path("a.csv"), "x")
    else:
        np.testing.assert_array_equal(numbers(column, Path("a.csv"), "x"), expected)


def test_infinite_numbers_were_not_measured():
    column = np.array([0.5, -np.inf])
    np.testing.assert_array_equal(numbers(column, Path("a.csv"), "x"), [0.5, np.nan])


def test_texts_of_bytes_are_texts():
    """As numpy keeps labels of type S."""
    assert texts(np.array([b"give", "gr\xf6\xdfer".encode()])) == ["give", "gr\xf6\xdfer"]


@pytest.mark.parametrize("end", ["mm s^-1", "mm s-1", "mm.s**-1", "mm\u00b7s\u207b\u00b9", "mm/s"])
def test_a_unit_divided_by_seconds_is_known_however_it_is_written(end):
    table = Table(Path("a.csv"), (f"vx [{end}]",), lambda wanted: [])
    assert table.unit_of(table.names[0], "m/s") == "mm/s"
    with pytest.raises(BagError, match="that becomes m, got 'mm/s'"):
        table.unit_of(table.names[0], "m")
