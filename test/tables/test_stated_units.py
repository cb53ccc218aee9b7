# SPDX-License-Identifier: Apache-2.0
"""Units that names, lines and numbers of a table of text state."""

import numpy as np
import pytest
import yaml
from tables.exported_files import entry
from tables.imports import check_wrist, imported_csv, suggested_csv
from tables.odd_files import PLACE, SHARE, TIMES_S, cells, plain, table

from intent_recognition.errors import BagError
from intent_recognition.tables import Doubt, import_demonstrations, suggest_map
from intent_recognition.tables.import_map import ImportMap

ANGLES = ["x_degrees", "x_rad", "x deg", "x.Degrees"]


@pytest.mark.parametrize(
    "name", ["x [%]", "x [km]", "x (px)", "x_px", "x [V]", "x [mm s^-1]", *ANGLES]
)
def test_a_unit_that_is_unknown_or_of_an_angle_is_no_length(name, tmp_path):
    names = [name.replace("x", axis) for axis in "xyz"]
    samples, said = imported_csv(tmp_path, plain(head=",".join(["t", *names])), names)
    assert samples is None and f"expected a unit of {name} that becomes m" in said


@pytest.mark.parametrize(
    ("head", "said"),
    [
        ("t,x (furlong),y (furlong),z (furlong)", "unknown unit.* columns_unit.*: x .furlong., y"),
        ("t,x [1e-3 m],y [1e-3 m],z [1e-3 m]", "unknown unit.* columns_unit"),
        ("t,x,y,z,z", "none but z, each twice"),
    ],
)
def test_places_in_an_unknown_unit_or_with_an_axis_twice_are_no_joints(head, said, tmp_path):
    width = head.count(",") - 3
    rows = plain(head="").replace("\n", f"{',1' * width}\n")
    (tmp_path / "a.csv").write_text(head + rows)
    with pytest.raises(BagError, match=said):
        suggest_map(tmp_path / "a.csv")


@pytest.mark.parametrize("name", ["x (in.)", "x [inch]", "x [in]"])
def test_an_inch_may_have_a_point(name, tmp_path):
    head = ",".join(["t", *(name.replace("x", axis) for axis in "xyz")])
    _, _, (found,) = suggested_csv(tmp_path, plain(scale=1 / 25.4, head=head, form="{:.9f}"))
    np.testing.assert_allclose(found.samples[0].values, PLACE / 1000, atol=1e-8)


def test_infinite_numbers_tell_no_unit(tmp_path):
    table = plain(scale=0.001, hidden=range(60, 80), cell="inf")
    content, _, (found,) = suggested_csv(tmp_path, table)
    assert "columns_unit" not in content["observed"][0]
    seen = np.delete(np.arange(len(PLACE)), range(60, 80))
    np.testing.assert_allclose(found.samples[0].values[seen], PLACE[seen] / 1000, atol=1e-6)


def test_letters_of_axes_are_no_units(tmp_path):
    names = ["a (n)", "a (v)", "a (w)"]
    _, said = imported_csv(tmp_path, plain(head=",".join(["t", *names])), names)
    assert "expected a unit" not in said


@pytest.mark.parametrize("column", ["by name", "0"])
@pytest.mark.parametrize(
    ("head", "per_s"),
    [
        ("time_ms,x,y,z", 1e3),
        ("t [ms],x,y,z", 1e3),
        ("Time(us),x,y,z", 1e6),
        ("timestamp_ns,x,y,z", 1e9),
        ("elapsed_usec,x,y,z", 1e6),
        ("Time (Seconds),x,y,z", 1.0),
        ("t [min],x,y,z", 1 / 60),
        ("t,x,y,z\nms,mm,mm,mm", 1e3),
        ("t,wrist,wrist,wrist\nms,x,y,z", 1e3),
    ],
)
def test_the_unit_of_times_is_that_of_the_header(head, per_s, column, tmp_path):
    column = head.split(",")[0] if column == "by name" else column
    content = plain(head=head, at=lambda t: f"{per_s * t:.12g}")
    options = {"columns": ("1", "2", "3"), "unit": "mm"}
    check_wrist(imported_csv(tmp_path, content, time={"column": column}, **options), times_atol=1)
    wrong = {"column": column, "unit": "s" if per_s > 1.0 else "ms"}  # the map's is taken first
    assert imported_csv(tmp_path, content, time=wrong, **options)[0] is None


def test_joints_in_degrees_are_doubted_and_wrapped_ones_are_not(tmp_path):
    angles = 3.0 + 1.0 * SHARE[:, 0]
    wrapped = (angles + np.pi) % (2 * np.pi) - np.pi
    content = table(
        "t,a,b", lambda k: [f"{TIMES_S[k]}", f"{30 + 60 * SHARE[k, 0]}", f"{wrapped[k]}"]
    )
    (tmp_path / "a.csv").write_text(content)
    for column, doubted in (("a", True), ("b", False)):
        joint = {
            "topic": "/joint_states", "type": "sensor_msgs/msg/JointState", "joints": [column],
            "unit": "rad", "columns": [column],
        }  # fmt: skip
        content = {"observed": [joint], "task": "t", "time": {"column": "t"}}
        *doubts, _ = import_demonstrations(tmp_path / "a.csv", ImportMap.from_dict(content))
        assert [one.reason.count("degrees for radians") for one in doubts] == [1] * doubted
        assert all(isinstance(one, Doubt) for one in doubts)


ENDS = {"_MM": 1.0, " mm": 1.0, " [mm]": 1.0, " (mm)": 1.0, ".cm": 0.1, "-cm": 0.1, "/cm": 0.1,
        "_dm": 0.01, "_centimeters": 0.1, "_inches": 1 / 25.4, "_ft": 1 / 304.8, " [CM]": 0.1,
        ",cm": 0.1}  # fmt: skip


@pytest.mark.parametrize("end", ENDS)
def test_a_unit_at_the_end_of_names(end, tmp_path):
    names = [f"{axis}{end}" for axis in "xyz"]
    content = plain(scale=ENDS[end], head=",".join(["t", *(f'"{name}"' for name in names)]))
    check_wrist(imported_csv(tmp_path, content, names), atol=2e-6)
    suggested = yaml.safe_load(suggest_map(tmp_path / "a.csv"))["observed"][0]
    assert suggested["columns"] == names


@pytest.mark.parametrize(
    ("line", "scale"),
    [
        *((line, 0.1) for line in ("# units: cm", "Units,cm", "#Length Units = [cm]")),
        # what names no single unit says nothing
        *((line, 1e-3) for line in ("# units: SI", "# units: m, rad", "# unit of all is m")),
    ],
)
def test_a_unit_above_the_names(line, scale, tmp_path):
    check_wrist(imported_csv(tmp_path, f"{line}\n{plain(scale=scale)}"), atol=2e-6)


@pytest.mark.parametrize("said", ["mm", "m"])
def test_a_scene_that_stands_still_in_another_unit_is_named(said, tmp_path):
    content = table("t,x,y,z,a,b,c", lambda k: [f"{TIMES_S[k]}", *cells(k), "300.0", "200.0", "90"])
    (tmp_path / "a.csv").write_text(content)
    box = {**entry(["a", "b", "c"], columns_unit=said), "topic": "/box/pose", "context": True}
    observed = [entry(["x", "y", "z"], columns_unit="mm"), box]
    mapping = ImportMap.from_dict({"observed": observed, "task": "t", "time": {"column": "t"}})
    *doubts, found = import_demonstrations(tmp_path / "a.csv", mapping)
    assert not isinstance(found, Doubt) and len(doubts) == (said == "m")
    for doubt in doubts:
        assert "is 372 m from the origin of its frame. Likely millimetres" in doubt.reason
        assert doubt.reason.startswith("box/pose") and "columns_unit" in doubt.reason
