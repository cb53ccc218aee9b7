# SPDX-License-Identifier: Apache-2.0
"""Warp an annotated object onto a mesh or a cloud, and print its parameters (opening, volume,
height, lip, tilt) and grasp in the target's coordinates. docs/warping.md says how to annotate
objects.

source SOURCE      annotated object: a file, or `mug`
target TARGET      file of a mesh or point cloud
--report OUT.html  write a page with figures (without a name: %(const)s)
--mapping          label: carry the source's labels to the target's points; point: move the source's
                   points onto the target (default: %(default)s)
--scale SCALE      factor from the target's unit to metres, such as 0.001
--toward X Y Z     place of the other container [m]
--viewpoint X Y Z  where the camera was [m], for clouds without normals
--seed SEED        seed of the points sampled on a mesh
--grasp            carry the source's grasp to the target: where, from where, how wide
--json OUT         the parameters

# a mesh, with the shipped mug
intent warp mug bowl.obj
# in millimetres, for a script
intent warp mug cup.stl --scale 0.001 --json
# the grasp for a script
intent warp mug bowl.obj --grasp --json
# a cloud without normals
intent warp mug seen.ply --viewpoint 0.5 0 0.6
"""

import argparse
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table
from scipy.spatial.transform import Rotation

from intent_recognition.cli import output
from intent_recognition.cli.console import boxed_table, say
from intent_recognition.cli.options import number
from intent_recognition.errors import ArgumentError
from intent_recognition.objects import find_object, load_object, load_target
from intent_recognition.warping import (
    ObjectModel,
    Part,
    PouringParameters,
    WarpedObject,
    check_wall,
    pouring_parameters,
    warp_grasp,
    warp_object,
)

ROWS = (
    ("opening radius", "opening_radius_m", 1e3, "mm"),
    ("volume", "volume_m3", 1e6, "ml"),
    ("height", "height_m", 1e3, "mm"),
    ("opening centre", "opening_centre", 1e3, "mm"),
    ("lip point", "lip_point", 1e3, "mm"),
    ("tilt that leaves half", "tilt_reference_rad", 180.0 / np.pi, "deg"),
    ("thickness of the wall", "wall_m", 1e3, "mm"),
    ("grasp: middle of the pads", "position", 1e3, "mm"),
    ("grasp: width", "width_m", 1e3, "mm"),
    ("grasp: the hand approaches", "approach", 1.0, ""),
    ("grasp: the fingers close", "closing", 1.0, ""),
)
"""Rows of the table: title, name in the JSON, factor to the unit, and unit."""


OPTIONS = {
    "report": {"nargs": "?", "const": Path("warp.html")},
    "mapping": {"choices": ("label", "point"), "default": "label"},
    "scale": {"type": number(float, 1e-9, 1e9), "default": 1.0},
    "toward": number(float),
    "viewpoint": number(float),
    "seed": {"type": number(int, 0), "default": 0},
}


def run(args: argparse.Namespace) -> int:
    """Warp, and print the results."""
    output.check_outputs(args, "report")
    source = ObjectModel.learn(load_object(find_object(str(args.source))))
    viewpoint = None if args.viewpoint is None else np.array(args.viewpoint)
    target = load_target(args.target, scale=args.scale, viewpoint=viewpoint, seed=args.seed)
    start_s = time.perf_counter()
    try:
        warped = warp_object(source, target.cloud, args.mapping)
        if target.surface is not None:
            check_wall(warped, target.surface)
        toward = None if args.toward is None else np.array(args.toward)
        parameters = pouring_parameters(warped, toward)
        grasp = warp_grasp(source, warped) if args.grasp else None
    except ArgumentError as error:
        raise ArgumentError(f"{args.target}: {error}") from error
    taken_s = time.perf_counter() - start_s
    content = as_json(args, warped, parameters, target.wall_m)
    if grasp is not None:
        content["grasp"] = {
            "position": grasp.centre.tolist(),
            "orientation": Rotation.from_matrix(grasp.pose[:3, :3]).as_quat().tolist(),
            "approach": grasp.approach.tolist(),
            "closing": grasp.closing.tolist(),
            "width_m": grasp.width_m,
        }
    output.write_json(args.json, content)
    console = output.table_console(args)
    console.print(_table(content))
    parts = ", ".join(f"{n} {part}" for part, n in content["points"].items())
    say(console, f"{len(warped.points)} points: {parts}; {1e3 * taken_s:.0f} ms")
    if args.report:
        from intent_recognition.report import warp_page

        names = f"{args.source} onto {args.target}"
        output.write_report(console, args.report, warp_page, source, warped, parameters, names)
    return 0


def as_json(
    args: argparse.Namespace, warped: WarpedObject, parameters: PouringParameters, wall_m: float
) -> dict[str, Any]:
    """All results as plain values: metres, cubic metres, radians."""
    values = {
        name: value.tolist() if isinstance(value, np.ndarray) else float(value)
        for name, value in parameters._asdict().items()
    }
    counts = np.bincount(warped.labels, minlength=len(Part))
    return {
        "source": str(args.source),
        "target": str(args.target),
        "mapping": warped.mapping,
        **values,
        "up": warped.rim.up.tolist(),
        "has_handle": warped.frame.has_handle,
        "wall_m": wall_m if np.isfinite(wall_m) else None,
        "points": {part.name.lower(): int(counts[part]) for part in Part},
    }


def _table(content: Mapping[str, Any]) -> Table:
    title = f"{content['source']} warped onto {content['target']}"
    table = boxed_table(title, "parameter", ">value", "unit")
    for title, name, factor, unit in ROWS:
        value = (content | content.get("grasp", {})).get(name)
        if value is None:
            continue
        digits = 1 if unit else 2
        rounded = np.round(np.atleast_1d(value) * factor, digits) + 0.0  # avoids -0.0
        shown = (f"{number:.{digits}f}" for number in rounded)
        table.add_row(title, "  ".join(shown), unit)
    return table
