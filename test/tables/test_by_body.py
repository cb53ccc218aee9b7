# SPDX-License-Identifier: Apache-2.0
"""Tables with a row for each body and moment are read as those with a row for each moment."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from intent_recognition.tables.by_body import by_body
from intent_recognition.tables.files import open_table
from intent_recognition.tables.table import table_of

AXES = ("x", "y", "z")


def rows_of(times, places, order, column="marker"):
    """Columns of rows, as texts: where bodies were (n, b, 3) at some times, in some order."""
    moment, body = np.divmod(order, places.shape[1])
    columns = {"trial": np.full(len(order), "7", object), "t": times[moment].astype(object)}
    columns[column] = np.array([f"m{b}" for b in body], object)
    return columns | {a: places[moment, body, k] for k, a in enumerate(AXES)}


@given(st.integers(2, 5), st.integers(4, 9), st.booleans(), st.integers(0, 2**32 - 1))
def test_every_place_is_where_it_was_measured(n_bodies, n, is_sorted, seed):
    rng = np.random.default_rng(seed)
    times, places = np.arange(n) / 100.0, rng.normal(size=(n, n_bodies, 3))
    order = np.arange(n * n_bodies)
    order = order if is_sorted else order.reshape(n, n_bodies).T.ravel()  # one body after another
    hidden = order[rng.integers(n, len(order))]  # at a moment that another body has
    seen = order[order != hidden]
    wide = by_body(table_of("tracked.csv", rows_of(times, places, seen)))
    names = [f"m{b}.{a}" for b in range(n_bodies) for a in AXES]
    assert sorted(wide.names) == sorted(["trial", "t", *names])
    columns = wide.columns(["trial", "t", *names])
    np.testing.assert_array_equal(columns["t"].astype(float), times)
    assert set(columns["trial"]) == {"7"}
    places[np.divmod(hidden, n_bodies)] = np.nan
    found = np.array([columns[name] for name in names]).T.reshape(places.shape)
    np.testing.assert_array_equal(found, places)


@pytest.mark.parametrize(
    ("column", "n_bodies", "again"),
    [
        ("marker", 1, 0.0),  # one body alone
        ("marker", 2, 1.0),  # each is seen at times of its own
        ("object", 2, 0.0),  # one after another: recordings of two tasks, perhaps
        ("task", 2, 0.0),
    ],
)
def test_other_tables_stay(column, n_bodies, again):
    places = np.random.default_rng(1).normal(size=(6, n_bodies, 3))
    order = np.arange(6 * n_bodies).reshape(6, n_bodies).T.ravel()
    columns = rows_of(np.arange(6.0), places, order, column)
    columns["t"] = columns["t"] + 6.0 * again * (columns[column] == "m1")
    table = table_of("tracked.csv", columns)
    assert by_body(table) is table


@pytest.mark.parametrize(
    ("column", "named"), [("person", True), ("sensor", True), ("colour", False), ("id", False)]
)
def test_rows_of_bodies_that_alternate_at_times_of_their_own_are_named(column, named):
    rows = np.arange(12)
    values = rows.astype("U2").astype(object) if column == "id" else np.tile(["ann", "bob"], 6)
    columns = {"t": rows / 100.0, column: values, "x": rows % 2.0}
    notes = by_body(table_of("tracked.csv", columns)).notes
    assert len(notes) == named and all("rows of ann, bob alternate" in note for note in notes)


@pytest.mark.parametrize(
    ("first", "said", "name"),
    [
        ("topic", "aa", "child_frame_id"),
        ("sensor_type", "aa", "name"),
        ("marker_type", "ab", "marker"),
    ],
)
def test_names_tell_bodies_apart_before_what_they_may_share(first, said, name):
    columns = {"t": np.repeat(np.arange(6.0), 2), first: np.tile([*said], 6)}
    columns |= {name: np.tile(["m1", "m2"], 6), "x": np.arange(12.0)}
    assert {"m1.x", "m2.x"} < {*by_body(table_of("tracked.csv", columns)).names}


def test_a_csv_of_bodies_is_read_with_its_units(tmp_path):
    lines = [f"{k / 100},{b},{k + 10 * n},1,2,3" for k in range(5) for n, b in enumerate("ab")]
    path = tmp_path / "tracked.csv"
    path.write_text("\n".join(["time,rigid body,x [mm],y [mm],z [mm],dim", *lines]))
    table = open_table(path)
    assert table.names[:5] == ("time", "a.x [mm]", "a.y [mm]", "a.z [mm]", "a.dim")
    assert table.unit_of("b.x [mm]", "m") == "mm"
    assert table.columns(["b.x [mm]"])["b.x [mm]"].tolist() == ["10", "11", "12", "13", "14"]


@pytest.mark.parametrize("columns", [["variable"], ["measurement", "field"], ["marker", "axis"]])
def test_a_row_for_each_number_becomes_a_column(columns, tmp_path):
    """As pandas' melt, InfluxDB and tidy tables have it."""
    names = {"variable": "m_{}", "field": "tracker,m_{}", "axis": "m,{}"}[columns[-1]]
    lines = [
        f"{t / 100},{names.format(axis)},{t + k / 10}"
        for k, axis in enumerate(AXES)
        for t in range(9)
    ]
    (tmp_path / "a.csv").write_text("\n".join([f"t,{','.join(columns)},value", *lines]))
    wide = open_table(tmp_path / "a.csv").columns(
        [f"m{'._'['axis' not in columns]}{a}" for a in AXES]
    )
    expected = np.arange(9.0) + np.arange(3)[:, None] / 10
    np.testing.assert_allclose(np.array([*wide.values()], float), expected)


@pytest.mark.parametrize("dtype", [np.int64, bool, "U2", "datetime64[s]"])
def test_columns_of_any_type_are_told_apart_and_nothing_is_called_by_an_old_name(dtype):
    values = np.array([1, 0, 1, 1, 0]).astype("int64").astype(dtype)
    columns = {"t": np.array([0.0, 0.0, 1.0, 1.0, 2.0]), "x": values}
    columns |= {"marker": np.array(["a", "b", "a", "b", "a"], object)}
    wide = by_body(table_of("tracked.parquet", columns, aliases={"pose.x": 1}))
    assert set(wide.names) == {"t", "a.x", "b.x"} and wide.find("pose.x") is None
    found = wide.columns(["a.x", "b.x"])
    assert found["a.x"].tolist() == values[[0, 2, 4]].tolist()
    *seen, missing = found["b.x"].tolist()
    assert seen == values[[1, 3]].tolist() and (missing == "" or np.isnan(missing))
