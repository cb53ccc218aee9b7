# SPDX-License-Identifier: Apache-2.0
"""Parquet files and pandas' tables of HDF5: read right, or what is odd is named."""

import pickle

import numpy as np
import pytest
from tables.imports import check_wrist, imported, suggested
from tables.odd_files import PLACE, ROWS, TIMES_S, of_bodies, parquet_file

from intent_recognition.errors import BagError
from intent_recognition.tables.files import open_table


@pytest.mark.parametrize("stated", ["metadata", "name"])
def test_units_of_parquet(stated, tmp_path):
    pa = pytest.importorskip("pyarrow")
    about = {"unit": "cm"} if stated == "metadata" else None
    names = ["x", "y", "z"] if about else ["x [cm]", "y (cm)", "z_cm"]
    fields = [
        pa.field("t", pa.float64()),
        *(pa.field(n, pa.float64(), metadata=about) for n in names),
    ]
    made = pa.table([TIMES_S, *(PLACE.T / 10)], schema=pa.schema(fields))
    pytest.importorskip("pyarrow.parquet").write_table(made, tmp_path / "a.parquet")
    check_wrist(imported(tmp_path, "a.parquet", None, names, time={"column": "t"}))


ROWS_OF = [dict(zip("xyz", row, strict=True)) for row in (PLACE / 1000).tolist()]
LAYOUTS = {
    "a struct": ({"w": ROWS_OF}, "w.{}"),
    "a list of structs": ({"w": [[{"p": row}] for row in ROWS_OF]}, "w.0.p.{}"),
    "levels": ({f"('w', '{axis}')": PLACE[:, k] / 1000 for k, axis in enumerate("xyz")}, "w.{}"),
    "bodies by name": ({"in": of_bodies("name", "cup", "wrist")}, "in.wrist.at.{}"),
    "bodies by id": ({"in": of_bodies("id", 7, 5)}, "in.5.at.{}"),
}


@pytest.mark.parametrize("kind", LAYOUTS)
def test_columns_of_parquet_in_any_layout(kind, tmp_path):
    columns, name = LAYOUTS[kind]
    parquet_file(tmp_path / "a.parquet", {"t": TIMES_S, **columns})
    names = [name.format(axis) for axis in ("012" if "at" in name else "xyz")]
    found = imported(tmp_path, "a.parquet", None, names, time={"column": "t"})
    check_wrist(found, atol=0.0, times_atol=1)


def test_images_are_no_hindrance_as_lerobot_stores_them(tmp_path):
    pa = pytest.importorskip("pyarrow")
    images = [{"bytes": b"", "path": f"{k}.png"} for k in range(ROWS)]
    columns = {"t": TIMES_S, **dict(zip("xyz", PLACE.T / 1000, strict=True)), "image": images}
    parquet = pytest.importorskip("pyarrow.parquet")
    parquet.write_table(pa.table(columns), tmp_path / "a.parquet", row_group_size=20)
    content, *_ = suggested(tmp_path / "a.parquet")
    assert content["observed"][0]["columns"] == ["x", "y", "z"]


def test_an_index_of_pandas_may_be_the_time(tmp_path):
    columns = {**dict(zip("xyz", PLACE.T / 1000, strict=True)), "__index_level_0__": TIMES_S}
    parquet_file(tmp_path / "a.parquet", columns)
    content, *_ = suggested(tmp_path / "a.parquet")
    assert content["time"] == {"column": "__index_level_0__", "unit": "s"}


def test_a_list_that_is_missing_was_not_measured_and_no_body_is_taken_for_another(tmp_path):
    lists = [None if k < 3 else row for k, row in enumerate((PLACE / 1000).tolist())]
    parquet_file(tmp_path / "a.parquet", {"w": lists})
    columns, time = ["w.0", "w.1", "w.2"], {"rate": 100}
    samples, _ = imported(tmp_path, "a.parquet", None, columns, time=time)
    assert np.isnan(samples.values[:3]).all()
    np.testing.assert_array_equal(samples.values[3:], PLACE[3:] / 1000)
    lists = [[{"name": name, "x": 0.0}] for name in ("cup", "wrist")]
    parquet_file(tmp_path / "b.parquet", {"bodies": lists})
    with pytest.raises(BagError, match="lists of the same names in bodies"):
        open_table(tmp_path / "b.parquet").columns(["bodies.cup.x"])


def test_the_columns_of_parquet_that_are_read_are_bounded(tmp_path, monkeypatch):
    columns = dict(zip("txyz", (TIMES_S, *PLACE.T / 1000), strict=True))
    notes = [f"{k:0>200}" for k in range(ROWS)]
    parquet_file(tmp_path / "a.parquet", columns | {"note": notes})
    monkeypatch.setattr("intent_recognition.tables.parquet.MOST_ARRAYS", 20_000)
    options = {"time": {"column": "t"}}
    check_wrist(imported(tmp_path, "a.parquet", None, **options))
    samples, said = imported(tmp_path, "a.parquet", None, task={"column": "note"}, **options)
    assert samples is None and "more than 20000" in said


@pytest.mark.parametrize("people", [[], ["Ann", "Bob"]])
def test_a_table_of_pandas_has_the_names_that_are_pickled_beside_it(people, tmp_path):
    """As DeepLabCut keeps them: the name of the network, persons, parts, and coordinates."""
    names = [
        ("net", *owner, part, axis)
        for owner in ([[one] for one in people] or [[]])
        for part in ("nose", "wrist")
        for axis in ("x", "y", "likelihood")
    ]
    values = np.tile(np.hstack([PLACE + 1000.0, PLACE])[:, : len(names)], 2)[:, : len(names)]
    rows = np.zeros(ROWS, [("index", int), ("values_block_0", float, (len(names),))])
    rows["values_block_0"] = values
    with pytest.importorskip("h5py").File(tmp_path / "a.h5", "w") as file:
        file["df/table"] = rows
        file["df/_i_table/index/sortedLR"] = np.arange(2000)
        file["df"].attrs["pandas_type"] = np.bytes_("frame_table")
        file["df/table"].attrs["values_block_0_kind"] = np.bytes_(pickle.dumps(names, 0))
    wanted = [".".join(name[1:]) for name in names]
    assert open_table(tmp_path / "a.h5").names == ("index", *wanted)
    columns, time = wanted[3:6], {"rate": 100}
    check_wrist(imported(tmp_path, "a.h5", None, columns, unit="mm", time=time), atol=1e-12)


@pytest.mark.parametrize("n_levels", [0, 2])
def test_the_fixed_format_of_pandas_has_its_names_and_index(n_levels, tmp_path):
    with pytest.importorskip("h5py").File(tmp_path / "a.h5", "w") as file:
        file["df/axis1"], file["df/block0_values"] = TIMES_S, PLACE / 1000
        file["df"].attrs.update({"pandas_type": np.bytes_("frame"), "nblocks": 1})
        if n_levels:
            file["df"].attrs["block0_items_nlevels"] = n_levels
            for k, (level, labels) in enumerate(
                [([b"w"], [0, 0, 0]), ([b"z", b"y", b"x"], [2, 1, 0])]
            ):
                file[f"df/block0_items_level{k}"] = np.array(level)
                file[f"df/block0_items_label{k}"] = np.array(labels)
        else:
            file["df/block0_items"] = np.array([b"w.x", b"w.y", b"w.z"])
    columns, time = ["w.x", "w.y", "w.z"], {"column": "index"}
    check_wrist(imported(tmp_path, "a.h5", None, columns, time=time), atol=0.0, times_atol=1)


def test_a_table_of_pandas_with_names_of_another_kind_has_columns_by_number(tmp_path):
    rows = np.zeros(ROWS, [("index", int), ("values_block_0", float, (3,))])
    rows["values_block_0"] = PLACE
    with pytest.importorskip("h5py").File(tmp_path / "a.h5", "w") as file:
        file["df/table"] = rows
        file["df"].attrs["pandas_type"] = np.bytes_("frame_table")
        names = np.bytes_(pickle.dumps([*map(np.str_, "xyz")], 0))
        file["df/table"].attrs["values_block_0_kind"] = names
    columns, time = [f"df.table.values_block_0.{k}" for k in range(3)], {"rate": 100}
    check_wrist(imported(tmp_path, "a.h5", None, columns, unit="mm", time=time), atol=1e-12)
