# SPDX-License-Identifier: Apache-2.0
"""Files as programs export them: columns by name, units, rates; never silently wrong.

docs/import.md lists the kinds of `exported_files`, docs/formats.md has a section for each.
"""

import re
from pathlib import Path

import numpy as np
import pytest
import yaml
from c3d_builder import c3d_file
from hypothesis import given, settings
from hypothesis import strategies as st
from tables import exported_files
from tables.exported_files import (
    EXAMPLES,
    PAGE,
    PLACE,
    PREFACE,
    SAY_MM,
    aloha,
    c3d,
    entry,
    kept,
    lerobot,
    openpose,
    robomimic,
    three,
)  # fmt: skip

from intent_recognition.errors import BagError
from intent_recognition.signals import Rejection
from intent_recognition.tables import ImportedDemonstration, c3d_reading, import_demonstrations
from intent_recognition.tables.files import open_table
from intent_recognition.tables.import_map import ImportMap
from intent_recognition.tables.times import SINCE_NS


def imported(path, columns, more=None, **keys):
    made = ImportMap.from_dict({"observed": [entry(columns, **keys)], "task": "t", **(more or {})})
    return list(import_demonstrations(path, made))


def c3d_of(folder, points, **options):
    return kept(folder / "a.c3d", c3d_file(points, **options))


@pytest.mark.parametrize("kind", EXAMPLES)
def test_a_file_as_it_is_exported(kind, tmp_path):
    make, columns, more = EXAMPLES[kind]
    unit = {"columns_unit": "mm"} if kind in SAY_MM else {}
    found, *others = imported(make(tmp_path), columns, more, **unit)
    (samples,) = found.samples
    np.testing.assert_allclose(samples.values, PLACE / 1000, rtol=0.0, atol=1e-9)
    steps = np.round(np.diff(samples.stamps_ns) * 1e-9, 4)
    assert set(steps.tolist()) <= {0.01, round(1 / 120, 4), 0.1}
    assert len(others) == kind.startswith(("robomimic", "LeRobot"))  # of two demonstrations


def test_the_page_lists_them(repository):
    page = (repository / "docs/import.md").read_text(encoding="utf-8")
    listed = set(re.findall(r"^\| ([^|]+?) \|", page, re.MULTILINE))
    assert set(EXAMPLES) <= listed


@pytest.mark.parametrize("kind", EXAMPLES)
def test_the_section_of_a_format_is_what_is_suggested_and_imports_it(kind, tmp_path):
    page, section = PAGE.read_text(encoding="utf-8"), exported_files.section(kind, tmp_path)
    assert page.startswith(PREFACE)
    assert section in page, "run python -m tables.exported_files in test/"
    content = yaml.safe_load(section.partition("```yaml")[2].removesuffix("```\n"))
    assert ("give the rate in Hz" in section) == ("time" not in content)
    content.setdefault("time", {"rate": 100})
    is_place = kind not in ("ALOHA, HDF5", "CSV without names")
    assert ("PoseStamped" if is_place else "JointState") in content["observed"][0]["type"]
    (path,) = tmp_path.iterdir()
    found, *_ = import_demonstrations(path, ImportMap.from_dict({**content, "task": "t"}))
    values = found.samples[0].values
    if is_place and kind != "BVH":  # which has the hips first
        np.testing.assert_allclose(values, PLACE / 1000, rtol=0.0, atol=1e-9)


UNITS = {"mm": 1e-3, "MM": 1e-3, "millimeters": 1e-3, "Millimetres": 1e-3, "in": 0.0254, "cm": 1e-2,
         "m": 1.0, "Meters": 1.0, "ft": 0.3048}  # fmt: skip


@pytest.mark.parametrize("unit", UNITS)
def test_a_unit_of_c3d_in_any_spelling(unit, tmp_path):
    points = (PLACE / 1000 / UNITS[unit])[:, None]
    (found,) = imported(c3d_of(tmp_path, points, units=unit, labels=["W"]), three("W"))
    np.testing.assert_allclose(found.samples[0].values, PLACE / 1000, rtol=1e-6)


@pytest.mark.parametrize("unit", [None, "", "parsec"])
def test_an_unknown_unit_of_c3d_is_asked_for(unit, tmp_path):
    (left_out,) = imported(c3d_of(tmp_path, PLACE[:, None], units=unit, labels=["W"]), three("W"))
    assert "columns_unit" in left_out.cure and (unit or "none") in left_out.reason
    (found,) = imported(tmp_path / "a.c3d", three("W"), columns_unit="mm")
    assert np.allclose(found.samples[0].values, PLACE / 1000)


def test_angles_and_forces_of_models_in_c3d_are_no_lengths(tmp_path):
    labels = ["W", "LElbowAngles", "LElbowForce"]
    more = {"ANGLES": labels[1:2], "ANGLE_UNITS": ["rad"], "FORCES": labels[2:]}
    points = np.repeat(PLACE[:, None], 3, axis=1)
    table = open_table(c3d_of(tmp_path, points, labels=labels, more=more))
    assert [table.said_of(f"{label}.z") for label in labels] == ["mm", "rad", "N"]
    file = pytest.importorskip("ezc3d").c3d(str(tmp_path / "a.c3d"))
    file.add_parameter("POINT", "POWERS", [1.5])  # of another program
    file.write(str(tmp_path / "a.c3d"))
    for read in (c3d_reading.ezc3d, c3d_reading.c3d):
        found = read(str(tmp_path / "a.c3d"))
        assert found["units"].tolist() == ["", "rad", "N"] and str(found["unit"]) == "mm"


def test_labels_that_occur_twice_are_refused_by_name_and_taken_by_number(tmp_path):
    points = np.stack([PLACE, PLACE + 100.0], axis=1)
    (left_out,) = imported(c3d_of(tmp_path, points, labels=["W", "W"]), three("W"))
    assert "twice 'W.x', the columns 0 and 3" in left_out.reason
    (found,) = imported(tmp_path / "a.c3d", [3, 4, 5])
    assert np.allclose(found.samples[0].values, (PLACE + 100.0) / 1000)


def test_zeros_of_an_occluded_marker_are_gaps_and_named(tmp_path):
    hidden = PLACE[:, None].copy()
    hidden[10:14], hidden[20, 0, 1] = 0.0, 0.0  # one coordinate may be zero
    said, found = imported(c3d_of(tmp_path, hidden, labels=["W"]), three("W"))
    assert said.reason == "frames at exactly (0, 0, 0) are taken for occlusion: W 4"
    assert np.sum(np.isnan(found.samples[0].values[:, 0])) == 4


@pytest.mark.parametrize("way", ["FRAMES", "TRIAL", "LONG_FRAMES"])
def test_more_frames_than_a_header_can_state(way, tmp_path):
    points = np.broadcast_to(
        np.float32(300.0) + np.arange(66_000)[:, None, None] % 7, (66_000, 1, 3)
    )
    (found,) = imported(c3d_of(tmp_path, points, labels=["W"], frames_by=way), three("W"))
    assert np.sum(np.isfinite(found.samples[0].values[:, 0])) == 66_000


@pytest.mark.parametrize("is_alone", [True, False])
def test_poses_of_bodies_are_at_their_origins(is_alone, tmp_path):
    """Theia writes no markers but a 4 x 4 matrix of each body."""
    file = pytest.importorskip("ezc3d").c3d()
    point = file["parameters"]["POINT"]
    point["RATE"]["value"], point["UNITS"]["value"] = [100.0], ["mm"]
    point["LABELS"]["value"] = [] if is_alone else ["hat"]
    file["data"]["points"] = np.ones((4, len(point["LABELS"]["value"]), len(PLACE)))
    poses = np.tile(np.eye(4)[:, :, None, None], (2, len(PLACE)))
    poses[:3, 3, 1] = PLACE.T
    file["data"]["rotations"] = poses
    file.add_parameter("ROTATION", "LABELS", ["pelvis_4X4", "hand_4X4"])
    file.add_parameter("ROTATION", "RATE", [100.0])
    file.write(str(tmp_path / "a.c3d"))
    (found,) = imported(tmp_path / "a.c3d", [f"hand_4X4.{axis}" for axis in "xyz"])
    np.testing.assert_allclose(found.samples[0].values, PLACE / 1000, atol=1e-6)


def test_more_than_255_markers_and_lax_headers(tmp_path):
    points = np.repeat(PLACE[:, None], 300, axis=1)
    points[:, 280] += 100.0
    names = [f"M{k}" for k in range(300)]
    (found,) = imported(c3d_of(tmp_path, points, labels=names), three("M280"))
    assert np.allclose(found.samples[0].values, (PLACE + 100.0) / 1000)
    sgi = {"order": ">"}
    for options in ({"repeat": True}, {"analog_stated": 9}, sgi, {**sgi, "analog_rate": 100.0}):
        (tmp_path / "b.c3d").write_bytes(c3d_file(PLACE[:, None], labels=["W"], **options))
        (found,) = imported(tmp_path / "b.c3d", three("W"))
        assert np.allclose(found.samples[0].values, PLACE / 1000)


MISFITS = {
    "points": ({"used": 2}, "ezc3d says: 2 points, 0 analog values and a scale of -1, where the "
               "header has frames of 144 bytes"),
    "scale": ({"scale": 0.1}, "a scale of 0.1, where the header has frames of 144 bytes"),
    "no marker": ({}, "got none: analog channels are not read"),
    "no frame": ({}, "/mocap/wrist/pose: empty: no samples with a time of its own"),
    "rate": ({"said_rate": 50.0}, "header: 50 Hz, POINT:RATE: 100 Hz, which is used"),
    "frames": ({"said_frames": 20}, "20 of 30 frames: its parameters state no more"),
    "frames of zeros": ({"said_frames": 400}, ""),
    "no count": ({"used": 0}, ""),
}  # fmt: skip
"""Headers and parameters that do not fit each other, and what is said."""


@pytest.mark.parametrize("kind", MISFITS)
def test_headers_and_parameters_that_do_not_fit_are_named(kind, tmp_path):
    options, says = MISFITS[kind]
    points = np.repeat(PLACE[:, None], 9, axis=1)
    points = points[: 0 if kind == "no frame" else None, : 0 if kind == "no marker" else None]
    labels = [*"WABCDEFGH"][: points.shape[1]]
    found = imported(c3d_of(tmp_path, points, labels=labels, **options), three("W"))
    said = [str(one) for one in found if isinstance(one, Rejection)]
    assert says in "".join(said) and bool(says) == bool(said)
    for one in found[len(said) :]:
        values = PLACE[: options.get("said_frames")] / 1000
        np.testing.assert_allclose(one.samples[0].values, values, rtol=1e-6)
        assert np.all(np.diff(one.samples[0].stamps_ns) == 10_000_000)


LABELS = {
    "other names": ({"LABELS2": ["wrist", "elbow"]}, ["W", "V", "unlabelled_2"]),
    "all again": ({"LABELS2": ["W", "V"]}, ["W", "V", "unlabelled_2"]),
    "all of them, the first again": ({"LABELS2": ["W", "V", "U"]}, ["W", "V", "U"]),
    "the rest": ({"LABELS2": ["U"]}, ["W", "V", "U"]),
    "other parameters": ({"XLABELS": ["a"], "LABELS_OLD": ["b"]}, ["W", "V", "unlabelled_2"]),
    "descriptions": ({"DESCRIPTIONS": ["wrist", "elbow", "hip"]}, ["W", "V", "unlabelled_2"]),
}
"""What else the parameters of three points say, whose LABELS are two, and their names."""


@pytest.mark.parametrize("library", ["ezc3d", "c3d"])
@pytest.mark.parametrize("kind", LABELS)
def test_labels_that_repeat_others_are_of_no_further_marker(kind, library, tmp_path):
    pytest.importorskip(library)
    more, names = LABELS[kind]
    data = c3d_file(np.repeat(PLACE[:, None], 3, axis=1), labels=["W", "V"], more=more)
    (tmp_path / "a.c3d").write_bytes(data)
    found = getattr(c3d_reading, library)(str(tmp_path / "a.c3d"))["labels"].tolist()
    assert found == [name for name in names if not name.startswith("unlabelled")]
    table = open_table(tmp_path / "a.c3d")
    assert table.names == tuple(f"{name}.{axis}" for name in names for axis in "xyz")


@pytest.mark.parametrize("order", ["<", ">"])
def test_a_file_that_crashes_one_library_is_read_by_the_other(order, tmp_path):
    """ezc3d 1.7.2 does of analog channels without scales."""
    pytest.importorskip("c3d")
    data = c3d_file(PLACE[:, None], labels=["W"], analog=3, order=order)
    (tmp_path / "a.c3d").write_bytes(data)
    (found,) = imported(tmp_path / "a.c3d", three("W"))
    assert np.allclose(found.samples[0].values, PLACE / 1000)


def csv(folder: Path, header: str, lines) -> Path:
    return kept(folder / "a.csv", "\n".join([header, *lines]) + "\n")


TIMES = {
    "dates": ("t", [f"2024-01-31 10:00:0{k}.123456789" for k in range(5)], {"column": "t"}),
    "zones": ("t", [f"2024-01-31T12:00:0{k}.123456789+02:00" for k in range(5)], {"column": "t"}),
    "two columns": (
        "sec,nanosec",
        [f"{1_706_695_200 + k},123456789" for k in range(5)],
        {"column": "sec", "nanoseconds": "nanosec"},
    ),
    **{
        unit: (
            "t", [f"{1_706_695_200 + k}{rest}" for k in range(5)],
            {"column": "t", "unit": unit, "since": 0},
        )
        for unit, rest in (("s", ".123456789"), ("ms", "123.456789"), ("ns", "123456789"))
    },
}  # fmt: skip


@pytest.mark.parametrize("kind", TIMES)
def test_times_of_a_clock_in_every_form(kind, tmp_path):
    name, cells, time = TIMES[kind]
    path = csv(tmp_path, f"{name},x,y,z", [f"{cell},0,0,0.{k}" for k, cell in enumerate(cells)])
    doubt, found = imported(path, ["x", "y", "z"], {"time": time})
    assert "are whole seconds. Likely milliseconds, or numbers of samples" in doubt.reason
    first = 1_706_695_200_123_456_789
    assert found.samples[0].stamps_ns.tolist() == [first + k * 10**9 for k in range(5)]


def test_a_time_of_day(tmp_path):
    lines = [f"10:00:0{k}.5,0,0,0.{k}" for k in range(5)]
    _, found = imported(csv(tmp_path, "t,x,y,z", lines), ["x", "y", "z"], {"time": {"column": "t"}})
    assert found.samples[0].stamps_ns[0] == SINCE_NS + 36_000_500_000_000


@pytest.mark.parametrize(
    ("cells", "said"),
    [
        ([f"{10 * k}" for k in range(10)], "Likely milliseconds"),
        ([f"{10_000 * k}" for k in range(10)], "Likely microseconds"),
        ([f"{10**7 * k}" for k in range(10)], "Likely nanoseconds"),
        ([f"{1_706_695_200_000_000_000 + k}" for k in range(10)], "Likely they are ns: say unit"),
    ],
)
def test_times_in_another_unit_are_named(cells, said, tmp_path):
    path = csv(tmp_path, "t,x,y,z", [f"{cell},0,0,0.{k}" for k, cell in enumerate(cells)])
    (left_out,) = imported(path, ["x", "y", "z"], {"time": {"column": "t"}})
    assert said in str(left_out)


def test_columns_that_are_not_used_never_matter(tmp_path):
    lines = [f"{k / 100},{k},0,0.{k:02d},oops,{'a' * k}" for k in range(10)]
    lines[3] += ",more,than,the,header"
    path = csv(tmp_path, "t,a,a,x,note,note", lines)
    (found,) = imported(path, ["x", "x", 2], {"time": {"column": "t"}})
    assert found.samples[0].values[9].tolist() == [0.09, 0.09, 0.0]


def test_names_that_differ_in_case_alone_are_two(tmp_path):
    path = csv(tmp_path, "t,x,X,y", [f"{k / 10},1,2,0.{k}" for k in range(5)])
    (found,) = imported(path, ["x", "X", "Y"], {"time": {"column": "T"}})
    assert found.samples[0].values[3].tolist() == [1.0, 2.0, 0.3]


@given(
    values=st.lists(st.floats(-1e6, 1e6), min_size=2, max_size=6),
    separator=st.sampled_from([";", "\t"]),
    encoding=st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "latin-1"]),
    comma=st.booleans(),
)
def test_any_number_is_read_as_it_is_written(values, separator, encoding, comma, tmp_path_factory):
    path = tmp_path_factory.mktemp("any") / "a.csv"
    text = f"ä{separator}b\n" + "".join(f"{v!r}{separator}1\n" for v in values)
    path.write_text(text.replace(".", ",") if comma else text, encoding=encoding)
    from intent_recognition.tables.cells import numbers

    (cells,) = open_table(path).columns(["ä"]).values()
    assert numbers(cells, path, "ä").tolist() == values


PLAIN = [
    kind for kind in EXAMPLES if EXAMPLES[kind][0] not in (c3d, robomimic, aloha, openpose, lerobot)
]
"""Those that are read in this process, from one file."""


@pytest.mark.parametrize("kind", PLAIN)
def test_a_damaged_file_is_left_out_or_read_and_nothing_else(kind, tmp_path):
    make, columns, more = EXAMPLES[kind]
    data = make(tmp_path).read_bytes()

    @settings(deadline=None, max_examples=20)
    @given(st.data())
    def damaged(draw):
        changed = bytearray(data[: draw.draw(st.integers(0, len(data)))])
        for _ in range(draw.draw(st.integers(0, 8)) if changed else 0):
            at = draw.draw(st.integers(0, len(changed) - 1))
            changed[at] = draw.draw(st.sampled_from(b'0,;.-e\t\n{}[]"<>/ \x00\xff9:X'))
        path = tmp_path / f"damaged{make(tmp_path).suffix}"
        path.write_bytes(changed)
        for found in imported(path, columns, more, columns_unit="mm"):
            assert isinstance(found, ImportedDemonstration | Rejection)

    damaged()


@pytest.mark.parametrize(("library", "name"), [("ezc3d", "a.c3d"), ("h5py", "a.h5")])
def test_what_a_library_says_is_said(tmp_path, library, name):
    pytest.importorskip(library)
    (tmp_path / name).write_bytes(b"\0" * 600)
    with pytest.raises(BagError, match=r"says|signature|Unable"):
        open_table(tmp_path / name)
