# SPDX-License-Identifier: Apache-2.0
"""Tables of text as labs send them: read right, or refused with what is wrong."""

import gzip
import re
from datetime import datetime, timedelta
from itertools import pairwise

import numpy as np
import pytest
import yaml
from tables.exported_files import entry
from tables.imports import check_wrist, demonstrations, imported, imported_csv
from tables.odd_files import PLACE, ROWS, TIMES_S, cells, day_time, plain, table

from intent_recognition.errors import BagError
from intent_recognition.tables import import_demonstrations, suggest_map
from intent_recognition.tables.files import find_tables, open_table
from intent_recognition.tables.import_map import ImportMap


def dated(seconds, form, start=datetime(2024, 1, 31, 11, 59, 59)):
    """A time on the last of January, before noon; `{}` are milliseconds."""
    at = start + timedelta(seconds=float(seconds))
    return at.strftime(form).format(f"{at.microsecond // 1000:03d}")


PLAIN = {
    "thousands with a point": plain("{:,.3f}", 10.0, ";"),
    "thousands, quoted": plain('"{:,.3f}"', 10.0),
    "thousands of the Swiss": plain("{:,.3f}", 10.0, ";").replace(",", "'"),
    "thousands with blanks": plain("{:,.3f}", 10.0, ";").replace(",", "\N{NO-BREAK SPACE}"),
    "thousands, without decimals of zero": plain("{:,.3f}", 10.0, ";").replace(".000", ""),
    "a row of units": plain(scale=10.0, head="t,x,y,z\ns,mm,mm,mm"),
    "comments": "# by me\n# on monday\n" + plain(scale=10.0),
    "a name behind a mark": plain(scale=10.0, head="# t,x,y,z"),
    "names between blanks behind a mark": plain(scale=10.0, separator=" ", head="# t,x,y,z"),
    "a comment and a name behind another mark": "% by me\n"
    + plain(scale=10.0, separator=" ", head="% t,x,y,z"),
    "a comment and a name behind a mark": "# by me\n" + plain(scale=10.0, head="# t,x,y,z"),
    "a last row that is cut": plain(scale=10.0) + "2.00,3",
    "comments between rows": plain(scale=10.0).replace("\n1.000,", "\n# cup\n% in, hand\n1.000,"),
    "zero bytes at the end": plain(scale=10.0).encode() + bytes(40),
    "UTF-16 without a mark": plain(scale=10.0).encode("utf-16-le"),
    "UTF-16, big end first": plain(scale=10.0).encode("utf-16-be"),
    "bars": plain(scale=10.0, separator="|"),
    "Excel's line of the separator": "sep=;\n" + plain(scale=10.0, separator=";"),
    "titles": "Monday\n\nby me, of the plate\n".replace(",", "") + plain(scale=10.0),
    "times of day over midnight": plain(scale=10.0, at=lambda t: day_time(86_399.0 + t)),
    **{
        f"dates as {form}": plain(scale=10.0, at=lambda t, form=form: dated(t, form))
        for form in (
            "%d.%m.%Y %H:%M:%S.{}", "%m/%d/%Y %I:%M:%S.{} %p", "%Y/%m/%d %H:%M:%S.{}",
            "%Y%m%dT%H%M%S.{}", "%Y-%m-%d %I.%M.%S.{} %p", "%Y-%m-%dT%H:%M:%S.{}+0100",
            "%Y-%m-%d %H:%M:%S.{} UTC", "%I:%M:%S.{} %p", "%M:%S.{}", "%H:%M:%S:{}",
            "%d-%b-%Y %H:%M:%S.{}", "1 day %H:%M:%S.{}",
        )
    },
    "dates over the midnight after which the day must come first": plain(
        scale=10.0, at=lambda t: dated(t, "%d/%m/%Y %H:%M:%S.{}", datetime(2024, 1, 12, 23, 59, 59))
    ),
    "many rows with texts below a blank line": table(
        "phase,t,x,y,z", lambda k: ["1" if k < 90 else "b", f"{TIMES_S[k]}", *cells(k, scale=10.0)]
    ).replace("\nb", "\n\nb", 1),
    "times in sec": plain(scale=10.0, at="{} sec".format),
    "times in min": plain(scale=10.0, at=lambda t: f"{t / 60:.12g} min"),
    "a comma": plain("{:.6f}", 10.0, ";", at=lambda t: f"{1 + t:.3f}".replace("1.500", "1,5")),
    "dates with decimal commas": plain(
        scale=10.0, separator=";", at=lambda t: f"2024-01-31 {day_time(t)}"
    ).replace(".", ","),
}  # fmt: skip


@pytest.mark.parametrize("kind", PLAIN)
def test_a_csv_that_can_be_read_in_one_way_is(kind, tmp_path):
    check_wrist(imported_csv(tmp_path, PLAIN[kind], unit="mm"), PLACE / 100, 1e-5, times_atol=1)


@pytest.mark.parametrize("name", ["a.csv", "a.tsv"])
def test_rows_at_which_nothing_was_measured_take_their_time(name, tmp_path):
    qtm = f"NO_OF_FRAMES,{ROWS}\nNO_OF_MARKERS,1\nFREQUENCY,100\nMARKER_NAMES,w\n"
    content = table("x,y,z", lambda k: [""] * 3 if 60 <= k < 80 else cells(k))
    if name == "a.tsv":
        content = content.replace("x,y,z\n", qtm).replace(",", "\t")
    time, unit = ({"time": {"rate": 100}}, {"unit": "mm"}) if name == "a.csv" else ({}, {})
    samples, said = imported(tmp_path, name, content, (0, 1, 2), **time, **unit)
    seen = np.delete(np.arange(ROWS), np.arange(60, 80))
    check_wrist((samples, said), PLACE[seen] / 1000)
    np.testing.assert_array_equal(samples.stamps_ns - samples.stamps_ns[0], seen * 10**7)


def test_cells_that_are_missing_at_the_end_of_a_row_were_not_measured(tmp_path):
    rows = table("t,x,y,z,in", lambda k: [f"{TIMES_S[k]}", *cells(k)[: 1 if 60 <= k < 80 else 3]])
    expected = np.where((np.arange(ROWS) // 20 == 3)[:, None] & [False, True, True], np.nan, PLACE)
    check_wrist(imported_csv(tmp_path, rows, unit="mm"), expected / 1000)


def test_a_last_line_without_an_end_is_left_out_where_cells_are_missing(tmp_path):
    content = table("t,x,y,z,a", lambda k: [f"{TIMES_S[k]}", *cells(k), "1"])
    check_wrist(imported_csv(tmp_path, content[:-4], unit="mm"), PLACE[:-1] / 1000)
    check_wrist(imported_csv(tmp_path, content[:-3] + "\nend of file\n", unit="mm"))
    check_wrist(imported_csv(tmp_path, content.replace("a\n", "a,\n")[:-1], unit="mm"))


@pytest.mark.parametrize(("first", "late_ns"), [(6, 0), (6, 7 * 10**6), (ROWS - 2, 0)])
def test_two_short_rows_whose_times_go_on_are_no_broken_one(first, late_ns, tmp_path):
    names, late_s = "t,x,y,z,a,b,c", 1e-9 * late_ns * (np.arange(ROWS) == first + 1)
    rows = [[f"{TIMES_S[k] + late_s[k]}", *cells(k), *["1"] * 3] for k in range(ROWS)]
    rows[first : first + 2] = [row[:4] for row in rows[first : first + 2]]
    found = imported_csv(tmp_path, table(names, rows.__getitem__), unit="mm")
    check_wrist(found, times_atol=late_ns)


HEADS = {
    "a key and value on each line": ("sep=,\nDeviceTag:,D1\nOutputRate:,100Hz\n\n", "t,x,y,z,in"),
    "texts in rows without names": ("", ""),
    "columns that are counted, as by pandas": ("", "0,1,2,3,4"),
}


@pytest.mark.parametrize("kind", HEADS)
def test_where_the_names_are_is_seen(kind, tmp_path):
    before, names = HEADS[kind]
    content = table(names, lambda k: [f"{TIMES_S[k]}", *cells(k), "world"])
    named = names.startswith("t")
    columns, time = (["x", "y", "z"], "t") if named else ([1, 2, 3], 0)
    content = before + content.lstrip("\n")
    check_wrist(imported_csv(tmp_path, content, columns, unit="mm", time={"column": time}))


def test_a_line_of_one_name_is_no_title_above_numbers(tmp_path):
    content = plain(scale=10.0, head="t,,,")
    check_wrist(imported_csv(tmp_path, content, [1, 2, 3], unit="mm"), PLACE / 100)


SECOND_LINES = {
    "units of some": ("n,t,x,y,z\n,,mm,mm,mm", ("x", "y", "z")),
    "a unit of the time alone": ("n,t,x mm,y mm,z mm\n,[s],,,", ("2", "3", "4")),
    "other texts": ("n,t,x,y,z\n,,lab,lab,lab", ("x", "y", "z")),
    "names of axes": ("n,t,wrist,,\n,,pos_x,pos_y,pos_z", ("wrist.pos_x", "3", "wrist.pos_z")),
    "axes with units": ("n,t,wrist,,\n,,X (mm),Y (mm),Z (mm)", ("2", "wrist.Y (mm)", "4")),
}
"""Two lines of a header, of which the second begins with empty cells, and columns."""


@pytest.mark.parametrize("kind", SECOND_LINES)
def test_a_second_line_of_the_header_is_no_row(kind, tmp_path):
    head, columns = SECOND_LINES[kind]
    content = table(head, lambda k: [str(k), f"{TIMES_S[k]}", *cells(k)])
    unit = {} if "mm,mm" in head or "(mm)" in head else {"unit": "mm"}
    check_wrist(imported_csv(tmp_path, content, columns, time={"column": "1"}, **unit))


NUMPY_2 = ", ".join(["np.float64({})"] * 3)


@pytest.mark.parametrize(
    "form", ['"({}, {}, {})"', "[{} {} {}]", "[ {}  {}  {}]", f'"[{NUMPY_2}]"']
)
@pytest.mark.parametrize("names", ["t,hand,note", "t [s],hand pos [m],note"])
def test_vectors_in_a_cell_are_columns(form, names, tmp_path):
    rows = [[f"{TIMES_S[k]:.2f}", form.format(*(PLACE[k] / 1000)), "(3)"] for k in range(ROWS)]
    rows[5][1] = ""
    path = tmp_path / "a.csv"
    path.write_text("\n".join([names, *map(",".join, rows)]))
    assert open_table(path).names[-1] == "note"  # one number is none
    mapping = ImportMap.from_dict(yaml.safe_load(suggest_map(path)))
    (found,) = import_demonstrations(path, mapping)
    expected = np.where(np.arange(ROWS)[:, None] == 5, np.nan, PLACE / 1000)
    np.testing.assert_allclose(found.samples[0].values, expected, atol=1e-8)
    rows[150][1] = form.format(1, 2, "x")
    path.write_text("\n".join([names, *map(",".join, rows)]))
    (found,) = import_demonstrations(path, mapping)
    assert "expected numbers, got" in found.reason and "in row 151" in found.reason


def test_minus_signs_of_unicode_are_read(tmp_path):
    content = plain("\N{MINUS SIGN}{:.6f}")
    check_wrist(imported_csv(tmp_path, content, unit="mm"), -PLACE / 1000)


@pytest.mark.parametrize(
    "cell",
    [
        "#N/A", "#DIV/0!", "-", "NaN", "inf", "-nan(ind)", "1.#QNAN", "<NA>", "NaT", r"\N", ".",
        "missing", "n.a.", "undefined",
    ],
)  # fmt: skip
def test_cells_of_what_was_not_measured(cell, tmp_path):
    samples, said = imported_csv(tmp_path, plain(hidden=range(60, 80), cell=cell), unit="mm")
    assert not said
    assert np.sum(np.isfinite(samples.values).all(axis=1)) == ROWS - 20


REFUSED = {
    "thousands without decimals": (plain("{:,.0f}", 10.0, ";"), "thousands?"),
    "a line of names within": (plain() + plain(), "its names again in row 201"),
    "a row on two lines": (plain().replace("0,20.5", "0\n20.5", 1), "4 cells, got 2 in row 2"),
    "a row on two lines, within a cell": (plain().replace("20.5", "2\n0.5", 1), "got 2 in row 2"),
    "the last row on two lines": (plain()[:-12] + "\n" + plain()[-12:], "got 2 in row 201"),
    "a row on two lines in unused columns": (
        table(
            "t,x,y,z,a,b,c", lambda k: [f"{TIMES_S[k]}", *cells(k), "1", "2" + "\n" * (k == 7), "3"]
        ),
        "7 cells, got 2 in row 9",
    ),
    "a title between rows": (plain() + "part 2\n" + plain(), "got 1 in row 201"),
    "row numbers without a name": (
        table("t,x,y,z", lambda k: [f"{k + 1}", f"{TIMES_S[k]}", *cells(k)]),
        "4 cells, one for each name, got 5 in row 1",
    ),
    "decimal commas between commas": (plain().replace(".", ","), "got 8 in row 1"),
    "in reverse": (table("t,x,y,z", lambda k: [f"{TIMES_S[~k]}", *cells(~k)]), "times decrease"),
    "one time": (plain(at=lambda t: "1.0"), "all rows have the same time"),
    "times without digits": (plain(at=lambda t: f"{1706410000 + t:.6g}"), "all rows have the same"),
    "blank times": (plain(at=lambda t: ""), "no row has a time"),
    "blank places": (plain(hidden=range(ROWS)), "every cell is empty"),
    "a unit below the names": (plain(head="t,x,y,z\ns,px,px,px"), "got 'px'"),
    "speeds below the names": (plain(head="t,x,y,z\ns,m/s,m/s,m/s"), "got 'm/s'"),
    "one row": ("t,x,y,z\n0,1,2,3\n", "empty: 1 sample with a time of its own"),
    "another kind of file": ("PK\3\4\0\0\0\1" * 20, "bytes that are no text"),
    "dates of which no order is possible": (
        table(
            "t,x,y,z", lambda k: [f"{'1/13' if k < ROWS - 1 else '13/1'}/2024 10:00:00", *cells(k)]
        ),
        "got '1/13/2024 10:00:00' in row 1 beside '13/1/2024 10:00",
    ),
    **{
        f"the time {text}": (plain(at=lambda t, text=text: text), "expected times")
        for text in ("10:00:00:12", "10:00", "13:00:00.5 PM", "31/31/2024 10:00:00")
    },
    **{
        f"no names in {content!r}": (content, "columns of the map")
        for content in ("\n5", "\n\n1,2\n3,4\n", "#\n\n1\n")
    },
}


@pytest.mark.parametrize("kind", REFUSED)
def test_what_can_be_read_in_several_ways_is_refused(kind, tmp_path):
    content, words = REFUSED[kind]
    unit = {} if words.startswith("got '") else {"unit": "mm"}
    samples, said = imported_csv(tmp_path, content, **unit)
    assert samples is None and words in said


def test_packed_tables_are_named(tmp_path):
    (tmp_path / "b.csv").write_text(plain())
    samples, said = imported(tmp_path, "a.csv.gz", gzip.compress(plain().encode()))
    assert samples is None and "expected an unpacked file, got .gz" in said
    mapping = ImportMap.from_dict({"observed": [entry(["x", "y", "z"], columns_unit="mm")],
                                   "task": "t", "time": {"column": "t"}})  # fmt: skip
    left_out, found = import_demonstrations(tmp_path, mapping)
    assert left_out.path.endswith("a.csv.gz") and found.name == "b"


ODD = {
    "times that go back": (
        table("t,x,y,z", lambda k: [f"{(k - 60 * (k > 99)) / 100}", *cells(k, scale=1e-3)]),
        140,
        "60 of 200 rows .* a clock that went back",
    ),
    "a clock that counts round": (
        table("t,x,y,z", lambda k: [f"{(k + 60) % 100 / 100}", *cells(k, scale=1e-3)]),
        40,
        "160 of 200 rows .* a clock that went back",
    ),
    "times without digits": (
        plain(scale=1e-3, at=lambda t: f"{1706410000 + t:.1f}"),
        21,
        "179 of 200 rows .* times that lost digits",
    ),
    "a clock that jumps": (
        table("t,x,y,z", lambda k: [f"{k / 100 + 3600 * (k > 99)}", *cells(k, scale=1e-3)]),
        ROWS,
        "no sample of mocap/wrist/pose for 3600 s",
    ),
    "metres called millimetres": (plain(scale=1e-6), ROWS, r"say in the map columns_unit: m\."),
    "a short reach in centimetres": (
        plain(scale=0.03),
        ROWS,
        "is hardly metres. Likely centimetres or inches for metres",
    ),
    "nothing": (plain(scale=1e-3), ROWS, "^$"),
}


@pytest.mark.parametrize("kind", ODD)
def test_what_is_odd_is_imported_and_named(kind, tmp_path):
    content, count, words = ODD[kind]
    samples, said = imported_csv(tmp_path, content)
    assert len(samples.stamps_ns) == count and re.search(words, said)


@pytest.mark.parametrize("late_s", [0.0, 0.0003])
def test_times_that_begin_anew_are_cut_there(late_s, tmp_path):
    starts = [0, 70, 150, ROWS]  # without a time in the last row of each
    times = np.concatenate([[*TIMES_S[: b - a - 1] + late_s * a, np.nan]
                            for a, b in pairwise(starts)])  # fmt: skip
    content = table("t,x,y,z", lambda k: [f"{times[k]:.3f}", *cells(k, scale=1e-3)])
    (tmp_path / "a.csv").write_text(content)
    said, *found = demonstrations(tmp_path / "a.csv", "xyz", rate=None)
    assert said.reason == "times begin anew: cut into 3 parts"
    assert [one.name for one in found] == ["a_000", "a_001", "a_002"]
    for (a, b), one in zip(pairwise(starts), found, strict=True):
        np.testing.assert_allclose(one.samples[0].values, PLACE[a : b - 1] / 1000, atol=1e-6)


LEVELS = {
    "DeepLabCut": "scorer,D,D,D,D,D,D\nbodyparts,nose,nose,nose,wrist,wrist,wrist\n"
    "coords,x,y,z,x,y,z",
    "one body": "scorer,D,D,D,D,D,D\nbodyparts,nose,nose,nose,wrist,wrist,wrist\n"
    "coords,x,y,likelihood,x,y,z",
    "Visual3D": "\tc:\\a.c3d\t\t\t\t\t\n\tnose\tnose\tnose\twrist\twrist\twrist\n"
    "\tTARGET\t\t\t\t\t\nITEM\tX\tY\tZ\tX\tY\tZ",
    "pandas": "time,nose,,,wrist,,\n,x,y,z,x,y,z",
    "pandas with an index": ",nose,nose,nose,wrist,wrist,wrist\n,x,y,z,x,y,z\nt,,,,,,",
    "a unit below the time": "time,nose,nose,nose,wrist,wrist,wrist\ns,x,y,z,x,y,z",
}


@pytest.mark.parametrize("kind", LEVELS)
def test_names_in_several_lines(kind, tmp_path):
    tab = "\t" if "\t" in LEVELS[kind] else ","
    content = table(LEVELS[kind], lambda k: [str(k), *cells(k)[::-1], *cells(k)], tab)
    options = {"columns": ["wrist.x", "wrist.y", "wrist.z"], "time": {"rate": 100}}
    assert "the unit" in imported_csv(tmp_path, content, **options)[1]
    assert open_table(tmp_path / "a.csv").names[0] not in ("s", "")
    check_wrist(imported_csv(tmp_path, content, unit="mm", **options), atol=1e-9)


def test_empty_columns_of_rosbag_to_csv_tell_repeated_names_apart(tmp_path):
    names = "t,stamp,secs,pose,position,x,y,z,orientation,x,y,z,w"
    content = table(names, lambda k: [f"{TIMES_S[k]}", "", "7", "", "", *cells(k), "", *"0001"])
    columns = ["position.x", "position.y", "position.z"]
    check_wrist(imported_csv(tmp_path, content, columns, unit="mm"), times_atol=1)
    assert {"secs", "orientation.w"} < {*open_table(tmp_path / "a.csv").names}
    content = table("t,note,x,y,z,p,p", lambda k: [f"{TIMES_S[k]}", "", *cells(k), "1", "1"])
    check_wrist(imported_csv(tmp_path, content, [*"xyz"], unit="mm"), times_atol=1)


@pytest.mark.parametrize("name", ["a.dat", "a.log"])
def test_a_dat_or_log_is_a_table_of_text(name, tmp_path):
    check_wrist(imported(tmp_path, name, plain(), unit="mm", time={"column": "t"}))


def test_a_log_beside_tables_is_of_a_program(tmp_path):
    for name in ("a.csv", "a.log"):
        (tmp_path / name).write_text(plain())
    assert find_tables(tmp_path) == [tmp_path / "a.csv"]


def test_yaml_of_messages_is_refused_with_what_writes_a_table(tmp_path):
    (tmp_path / "a.yaml").write_text("position: [0.0]\n---\n" * 9)
    with pytest.raises(BagError, match="ros2 topic echo --csv"):
        find_tables(tmp_path / "a.yaml")
