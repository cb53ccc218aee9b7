# SPDX-License-Identifier: Apache-2.0
"""Motion capture as labs send it: read right, or what was left out is named."""

import re

import numpy as np
import pytest
import yaml
from c3d_builder import c3d_file
from tables.exported_files import PLACE as EXPORTED
from tables.exported_files import bvh, motive, qtm, three, trc
from tables.imports import check_wrist, imported
from tables.odd_files import DEVICES, NEXUS, PLACE, ROWS, TIMES_S, cells, nexus, table

from intent_recognition.tables import suggest_map


@pytest.mark.parametrize("before", ["", DEVICES + "1,0,1,2,3\n" * 300 + "\n"])
def test_nexus_counts_frames_wherever_its_places_are(before, tmp_path):
    rows = [k for k in range(ROWS) if not 80 <= k < 120]
    columns = [f"Ann:RWRA.{axis}" for axis in "XYZ"]
    found = imported(tmp_path, "a.csv", nexus(rows, before=before), columns)
    check_wrist(found, PLACE[rows] / 1000)
    steps = np.diff(found[0].stamps_ns)
    assert steps.max() == 410_000_000 and np.median(steps) == 10_000_000


@pytest.mark.parametrize("rows", [(), ("Type", "Name", "ID")])
@pytest.mark.parametrize("has_blank_line", [True, False])
def test_a_header_of_motive_without_names_of_its_rows(rows, has_blank_line, tmp_path):
    content = motive(tmp_path).read_text()
    for name in ("Type", "Name", "ID"):
        content = content if name in rows else content.replace(f",{name},", ",,", 1)
    content = content if has_blank_line else content.replace("\n\n", "\n")
    columns = [f"wrist.Position.{axis}" for axis in "XYZ"]
    check_wrist(imported(tmp_path, "a.csv", content, columns), EXPORTED / 1000)
    _, below = content.split("\n", 1)  # without the header information
    check_wrist(imported(tmp_path, "b.csv", below, columns, unit="mm"), EXPORTED / 1000)
    content = content.replace("Space,Global", "Space,Local").replace("Name,a", "Name,left, up")
    assert "frame of each parent" in imported(tmp_path, "a.csv", content, columns)[1]


VICON = {
    "Tracker": (
        "Objects\n100\n,,wrist:wrist,,,,,\nFrame,Sub Frame,RX,RY,RZ,TX,TY,TZ\n"
        ",,rad,rad,rad,mm,mm,mm\n",
        "wrist.T{}", ["0"] * 3, "",
    ),
    "Nexus with angles before": (
        "Model Outputs\n100\n,,Elbow,,\nFrame,Sub Frame,X,Y,Z\n,,deg,deg,deg\n1,0,9,9,9\n\n"
        + NEXUS.format("Ann", "Bob"), "Ann:RWRA.{}", [], "only Trajectories are read, not Model",
    ),
    "Nexus with events before": (
        "Events\n100\nSubject,Context,Name\nAnn,Right,Strike\n\n" + NEXUS.format("Ann", "Bob"),
        "Ann:RWRA.{}", [], "",
    ),
}  # fmt: skip
ANGLES = VICON["Nexus with angles before"]
VICON["Nexus below blank lines"] = ("\n\n" + ANGLES[0], *ANGLES[1:])


@pytest.mark.parametrize("kind", VICON)
def test_the_places_of_vicon_are_read_and_other_tables_named(kind, tmp_path):
    head, name, before, words = VICON[kind]
    body = "".join(f"{k + 1},0,{','.join([*before, *cells(k)])}\n" for k in range(ROWS))
    columns = [name.format(axis) for axis in "XYZ"]
    samples, said = imported(tmp_path, "a.csv", head + body, columns)
    assert words in said and bool(words) == bool(said)
    np.testing.assert_allclose(samples.values, PLACE / 1000, atol=1e-8)


def test_the_table_of_nexus_1_has_neither_units_nor_sub_frames(tmp_path):
    content = "ANALOG\n1000,Hz\nSample #,Fx\nUnits:,N\n" + "1,2\n" * 100
    content += "\nTRAJECTORIES\n100,Hz\n,Ann:RWRA,,\nField #,X,Y,Z\n"
    content += "".join(f"{k + 1},{','.join(cells(k))}\n" for k in range(ROWS))
    columns = [f"Ann:RWRA.{axis}" for axis in "XYZ"]
    found = imported(tmp_path, "a.csv", content, columns, unit="mm")
    check_wrist(found, times_atol=2)


QTM = f"NO_OF_FRAMES\t{ROWS}\nFREQUENCY\t100\nDATA_INCLUDED\t3D\n"
BODY = "wrist X\tY\tZ\tRoll\tPitch\tYaw\tResidual\n"
SKELETON = "REFERENCE\tGLOBAL\nSCALE\t1\nSOLVER\tstandard\nhips\twrist\tX\tY\tZ\tQX\n"


@pytest.mark.parametrize(
    ("head", "after"),
    [
        (f"FILE_VERSION\t2.0.0\n{QTM}EVENT\tgo\t1\t0.1\nMARKER_NAMES\twrist\n", []),
        (QTM + SKELETON, ["1"]),
        (QTM + "MARKER_NAMES\twrist\nFrame\tSMPTE\twrist X\twrist Y\twrist Z\n", []),
        (QTM + "MARKER_NAMES\twrist\nTRAJECTORY_TYPES\tMeasured\n", []),
        (QTM + f"BODY_NAMES\twrist\nBODY_FILTERS\tNone\n{BODY}", ["1", "2", "3", "0.1"]),
        (QTM + f"BODY_NAMES\twrist\n{BODY}", ["1", "2", "3", "0.1"]),
    ],
)
def test_markers_and_bodies_of_qtm(head, after, tmp_path):
    before = ["", ""] * ("SOLVER" in head or "SMPTE" in head)
    body = "".join("\t".join([*before, *cells(k), *after]) + "\n" for k in range(ROWS))
    check_wrist(imported(tmp_path, "a.tsv", head + body, [f"wrist.{axis}" for axis in "xyz"]))


@pytest.mark.parametrize("first", ["", "LWR"])
@pytest.mark.parametrize("end", ["", "\t\t\t"])
def test_a_marker_without_a_label_moves_no_other(first, end, tmp_path):
    """Programs of motion capture write those that nobody has labelled, too, with empty names."""
    other = ["1", "2", "3"]
    after = other if end else []
    body = "".join("\t".join([*other, *cells(k), *after]) + "\n" for k in range(ROWS))
    head = QTM + f"NO_OF_MARKERS\t{2 + bool(end)}\nMARKER_NAMES\t{first}\tRWR{end[:1]}\n"
    samples, _ = imported(tmp_path, "a.tsv", head + body, [f"RWR.{axis}" for axis in "xyz"])
    np.testing.assert_allclose(samples.values, PLACE / 1000, atol=1e-8)
    frame = "Frame" if end else "Frame#"
    head = (
        "PathFileType\t4\t(X/Y/Z)\ta.trc\nDataRate\tUnits\n100\tmm\n"
        f"{frame}\tTime\t{first}\t\t\tRWR\t\t{end}\n\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n\n"
    )
    body = "".join(f"{k + 1}\t{TIMES_S[k]}\t{row}\n" for k, row in enumerate(body.splitlines()))
    samples, _ = imported(tmp_path, "a.trc", head + body, [f"RWR.{axis}" for axis in "xyz"])
    np.testing.assert_allclose(samples.values, PLACE / 1000, atol=1e-8)


def test_a_header_that_is_known_needs_no_skip_rows(tmp_path):
    content = motive(tmp_path).read_text()
    for names, words in (("wrist.Position.{}", ""), ("{}", "got Frame, Time (Seconds), wrist.Rot")):
        columns = [name.format(axis) for axis in "XYZ" for name in [names]]
        samples, said = imported(tmp_path, "a.csv", content, columns, skip_rows=6)
        assert words in said and (samples is None) == bool(words)


@pytest.mark.parametrize("names", ["R_x\tR_y\tR_z\tL_x\tL_y\tL_z", "R\t\t\tL\t\t"])
def test_a_trc_without_a_line_of_axes_loses_no_row_and_no_name(names, tmp_path):
    head = "PathFileType\t4\t(X/Y/Z)\ta.trc\nDataRate\tUnits\n100\tmm\nFrame#\tTime\t"
    body = [f"{k + 1}\t{k / 100:.2f}\t{k}\t20\t30\t{k + 7}\t50\t60\n" for k in range(30)]
    end = "_" if "_x" in names else "."
    wanted = [f"L{end}{axis}" for axis in "xyz"]
    samples, _ = imported(tmp_path, "a.trc", f"{head}{names}\n{''.join(body)}", wanted)
    assert np.allclose(samples.values[:, 0] * 1000.0, np.arange(30) + 7.0)


@pytest.mark.parametrize("kept", [r"\1", r"\1\2"])  # no times, or those with one decimal
@pytest.mark.parametrize("kind", [motive, trc])
def test_where_times_are_blank_frames_count_at_the_rate_of_the_file(kind, kept, tmp_path):
    text = re.sub(r"(?m)^(\d+[,\t])(\d+\.\d)\d+", kept, kind(tmp_path).read_text())
    columns = {motive: "wrist.Position.{}", trc: "RWR.{}"}[kind]
    samples, _ = imported(tmp_path, f"b{kind(tmp_path).suffix}", text, map(columns.format, "xyz"))
    steps = np.diff(samples.stamps_ns) * 1e-9
    np.testing.assert_allclose(steps, 1 / 120 if kind is motive else 0.01, atol=2e-9)


@pytest.mark.parametrize(("rate", "period"), [("99,5", 1 / 99.5), ("0", None)])
def test_rates_with_decimal_commas_and_none(rate, period, tmp_path):
    text = qtm(tmp_path).read_text().replace("FREQUENCY\t100", f"FREQUENCY\t{rate}")
    columns = ["wrist.x", "wrist.y", "wrist.z"]
    samples, said = imported(tmp_path, "qtm.tsv", text, columns)
    if period is None:
        assert samples is None and "time: rate: expected samples a second" in said
        head = text.replace("FREQUENCY\t0", "FREQUENCY\tEXT")  # an external clock
        assert "map, Time among them" in imported(tmp_path, "b.tsv", head, columns)[1]
    else:
        np.testing.assert_allclose(np.diff(samples.stamps_ns) * 1e-9, period, atol=2e-9)


def test_a_label_above_each_axis_is_of_one_marker(tmp_path):
    text = trc(tmp_path).read_text().replace("LWR\t\t\tRWR\t\t", "LWR\tLWR\tLWR\tRWR\tRWR\tRWR")
    samples, said = imported(tmp_path, "b.trc", text, ["RWR.x", "RWR.y", "RWR.z"])
    assert not said
    np.testing.assert_allclose(samples.values, EXPORTED / 1000)


@pytest.mark.parametrize("title", ["Positions", "Velocities", "Accelerations"])
def test_places_of_bodies_of_opensim_are_metres_and_no_speeds(title, tmp_path):
    names = "\t".join([f"hand_{axis}" for axis in (*"XYZ", "Ox", "Oy", "Oz")])
    head = f"{title}\ninDegrees=yes\nendheader\ntime\t{names}"
    rows = [[f"{TIMES_S[k]}", *cells(k, scale=0.001), *cells(k)] for k in range(ROWS)]
    path, content = tmp_path / "a.sto", table(head, rows.__getitem__, "\t")
    samples, said = imported(tmp_path, "a.sto", content, ["hand_X", "hand_Y", "hand_Z"])
    if title == "Positions":
        check_wrist((samples, said), atol=1e-6)
        assert "/mocap/hand_o" not in suggest_map(path)
    else:
        assert samples is None and "a unit of hand_X that becomes m, got 'm/s" in said


def test_places_of_forces_of_opensim_are_metres_and_frames_of_bvh_have_decimal_commas(tmp_path):
    names = "\t".join(f"ground_force_{name}" for name in ("px", "py", "pz"))
    content = table(
        f"grf\ninDegrees=yes\nendheader\ntime\t{names}",
        lambda k: [f"{TIMES_S[k]}", *cells(k, scale=0.001)], "\t",
    )  # fmt: skip
    check_wrist(imported(tmp_path, "a.mot", content, names.split("\t")), atol=1e-6)
    before, after = bvh(tmp_path).read_text().split("MOTION")
    after = after.replace(".", ",").replace("Time", "time")
    content, columns = f"{before}MOTION{after}", three("Right Wrist")
    check_wrist(imported(tmp_path, "b.bvh", content, columns, unit="mm"), EXPORTED / 1000)


UNITS_PER_M = {"m": 1.0, "cm": 100.0, "mm": 1000.0, "in": 1 / 0.0254, "ft": 1 / 0.3048}


@pytest.mark.parametrize(("bone", "unit"), [(0.5, "m"), (50.0, "cm"), (500.0, "mm")])
def test_the_unit_of_a_skeleton_is_guessed_by_its_size_not_by_where_it_walks(bone, unit, tmp_path):
    text = bvh(tmp_path).read_text().replace("OFFSET 0 500 0", f"OFFSET 0 {bone} 0")
    (tmp_path / "a.bvh").write_text(text)  # its hips are 900 of its units away
    assert f"columns_unit: {unit}  # guessed: {bone:g} m" in suggest_map(tmp_path / "a.bvh")


@pytest.mark.parametrize(("unit", "per_m"), UNITS_PER_M.items())
def test_the_unit_of_a_whole_person_is_that_in_which_it_has_the_size_of_one(unit, per_m, tmp_path):
    def joint(name, offset, *below, word="JOINT"):
        at = " ".join(f"{per_m * x:.5f}" for x in offset)
        channels = "CHANNELS 3 Zrotation Xrotation Yrotation"
        return "\n".join([f"{word} {name}", "{", f"OFFSET {at}", channels, *below, "}"])

    limbs = [joint(f"{side}Foot", (x, -0.9, 0)) for side, x in (("Left", 0.1), ("Right", -0.1))]
    arms = [joint(f"{side}Hand", (x, 0, 0)) for side, x in (("Left", 0.7), ("Right", -0.7))]
    chest = joint("Chest", (0, 0.5, 0), joint("Head", (0, 0.3, 0)), *arms)
    text = joint("Hips", (0, 0, 0), *limbs, chest, word="ROOT")
    frames = "\n".join(f"{9 * '0 '} {k} {11 * '0 '}" for k in range(20))
    path = tmp_path / "a.bvh"
    path.write_text(f"HIERARCHY\n{text}\nMOTION\nFrames: 20\nFrame Time: 0.01\n{frames}\n")
    suggestion = yaml.safe_load(suggest_map(path))
    entries = suggestion["observed"] + suggestion.get("controlled", [])
    assert {entry["columns_unit"] for entry in entries} == {unit}


def test_states_of_opensim_by_their_paths(tmp_path):
    names = [f"/jointset/ground/wrist_t{axis}/value" for axis in "xyz"]
    head = "inDegrees=no\nendheader\n" + "\t".join(["time", *names])
    content = table(head, lambda k: [f"{TIMES_S[k]}", *cells(k, scale=0.001)], "\t")
    check_wrist(imported(tmp_path, "a.sto", content, names), atol=1e-6)


def test_a_marker_of_two_people_is_named_with_its_person(tmp_path):
    columns = [f"RWRA.{axis}" for axis in "XYZ"]
    samples, said = imported(tmp_path, "a.csv", nexus(range(ROWS)), columns)
    assert samples is None and "Ann:RWRA.X" in said and "Bob:RWRA.X" in said
    points = np.stack([PLACE, PLACE + 100.0], axis=1)
    for labels, known in ((["Ann:RWRA", "Bob:RWRA"], False), (["Ann:RWRA", "Ann:LWRA"], True)):
        content = c3d_file(points, labels=labels)
        samples, _ = imported(tmp_path, "a.c3d", content, [f"RWRA.{axis}" for axis in "xyz"])
        assert (samples is not None) == known


@pytest.mark.parametrize("cell", ["0.000", "-9999", "-3.697314E+028"])
@pytest.mark.parametrize(
    ("name", "head", "column", "scale"),
    [
        ("a.tsv", QTM + "MARKER_NAMES\twrist", "wrist.{}", 1.0),
        ("a.csv", f"Format Version,1,Length Units,Millimeters\n,Name{',wrist' * 3}\n,"
         f"{',Position' * 3}\nFrame,Time (Seconds),X,Y,Z", "wrist.Position.{}", 1.0),
        ("b.csv", "row,time,x,y,z", "{}", 1e-3),
    ],
)  # fmt: skip
def test_one_number_for_all_columns_of_a_hidden_body_is_no_place(
    name, head, column, scale, cell, tmp_path
):
    gap, before = range(60, 80), 0 if name == "a.tsv" else 2
    rows = [cells(k, scale=scale) if k not in gap else [cell] * 3 for k in range(ROWS)]
    firsts = [[f"{k}", f"{TIMES_S[k]}"][:before] for k in range(ROWS)]
    separator = "," if before else "\t"
    content = table(head, lambda k: firsts[k] + rows[k], separator)
    more = {} if scale == 1.0 else {"time": {"column": "time"}}
    samples, said = imported(tmp_path, name, content, map(column.format, "xyz"), **more)
    assert re.fullmatch(r"frames at exactly \(.*\) are taken for occlusion: \S+ 20", said)
    wanted = np.where(np.isin(np.arange(ROWS), gap)[:, None], np.nan, PLACE / 1000)
    np.testing.assert_allclose(samples.values, wanted, atol=1e-6)
    (entry,) = yaml.safe_load(suggest_map(tmp_path / name))["observed"]
    assert entry.get("columns_unit") == ("mm" if scale == 1.0 else None)


def test_two_people_in_one_mvnx_are_refused(tmp_path):
    frame = '<frame time="0" type="normal"><position>0 0 0</position></frame>'
    person = f'<subject frameRate="100"><segments/><frames>{frame}</frames></subject>'
    samples, said = imported(tmp_path, "a.mvnx", f"<mvnx>{person}{person}</mvnx>")
    assert samples is None and "expected one person, got several" in said


def test_a_marker_that_was_never_seen_is_named_and_labels_may_be_latin(tmp_path):
    content = c3d_file(np.stack([0.0 * PLACE, PLACE], axis=1), labels=["W", "H\xe4nd"])
    columns = [f"W.{axis}" for axis in "xyz"]
    assert "is at exactly zero in every sample" in imported(tmp_path, "a.c3d", content, columns)[1]
    samples, said = imported(tmp_path, "a.c3d", content, [f"H\xe4nd.{axis}" for axis in "xyz"])
    assert not said and len(samples.values) == ROWS
