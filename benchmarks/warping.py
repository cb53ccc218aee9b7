# SPDX-License-Identifier: Apache-2.0
"""Warping one annotated mug onto other containers, and onto scanned ones."""

import warnings
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np
import trimesh

from benchmarks.measure import Result, at_most, seconds
from benchmarks.measured_mesh import MeasuredMesh, measure_mesh
from intent_recognition.errors import ArgumentError
from intent_recognition.objects import find_object, load_object, load_target
from intent_recognition.warping import (
    Mapping,
    ObjectCloud,
    ObjectModel,
    PouringParameters,
    check_wall,
    pouring_parameters,
    warp_object,
)
from sim_bridge.containers import CONTAINER_NAMES, Container, make_container, scan

SEEDS = (1, 2, 3)
HELD_OUT_SEEDS = (1001, 1002, 1003, 1004, 1005)
"""Of sizes and of noise, never looked at while the warping was made."""
VIEWS = (1, 2, 3)
SCANS = Path("../shared/data/meshes")
SCAN_SEEDS = (0, 1, 2)
BESIDE = np.array([0.4, 0.1, 0.0])
REQUIRED = {"radius": (1.0, "%"), "volume": (3.0, "%"), "height": (3.0, "%"), "tilt": (1.0, "deg")}
WORST = {"volume": (8.0, "%"), "tilt": (4.0, "deg")}
REQUIRED_OF_SCANS = {"radius": (3.0, "%"), "volume": (8.0, "%"), "tilt": (2.0, "deg")}


def warping() -> Iterator[Result]:
    """Errors of the warped parameters against the truth, and the time of a warp."""
    source = ObjectModel.learn(load_object(find_object("mug")))
    yield from _made(source, "label", "warping", SEEDS)
    yield from _made(source, "point", "warping by point mapping", SEEDS)
    yield from _made(source, "label", "warping, new seeds", HELD_OUT_SEEDS)
    yield from _made(source, "point", "point mapping, new seeds", HELD_OUT_SEEDS)
    yield from _time(source)
    if SCANS.is_dir():
        yield from _scanned(source)


def errors_of_made(
    source: ObjectModel, mapping: Mapping, seeds: Sequence[int] = SEEDS
) -> dict[str, np.ndarray]:
    """Errors by parameter over containers, seeds and one to three views."""
    rows = []
    for name in CONTAINER_NAMES:
        for seed in seeds:
            container = make_container(name, seed)
            for n_views in VIEWS if name != source.annotated.name else ():
                cloud = _cloud(container, seed, n_views)
                found = pouring_parameters(warp_object(source, cloud, mapping), BESIDE)
                rows.append(_errors(found, container, container.inner_volume_m3, BESIDE))
    return dict(zip(REQUIRED, np.abs(rows).T, strict=True))


def _made(
    source: ObjectModel, mapping: Mapping, name: str, seeds: Sequence[int]
) -> Iterator[Result]:
    found = errors_of_made(source, mapping, seeds)
    n = len(next(iter(found.values())))
    remark = f"{n} scans of 9 kinds, {len(seeds)} seeds, 1 to 3 views; {mapping} mapping"
    for key, (required, unit) in REQUIRED.items():
        median = float(np.median(found[key]))
        yield at_most(f"{name}, median {key} error", median, required, unit, remark)
    for key, (required, unit) in WORST.items():
        worst = float(found[key].max())
        yield at_most(f"{name}, worst {key} error", worst, required, unit, remark)


def _time(source: ObjectModel) -> Iterator[Result]:
    cloud = _cloud(make_container("tall_mug", 1), 1, 2)
    for mapping in ("label", "point"):
        taken_s = seconds(partial(_parameters, source, cloud, mapping), 21)
        name = f"one warp of 2000 points, {mapping} mapping"
        yield at_most(name, 1e3 * taken_s, 25.0, "ms", "parameters included")


def _parameters(
    source: ObjectModel, cloud: ObjectCloud, by: Literal["label", "point"]
) -> PouringParameters:
    return pouring_parameters(warp_object(source, cloud, by))


def _scanned(source: ObjectModel) -> Iterator[Result]:
    """Real cups, whose truth is measured from their meshes."""
    found, refused, unusable = [], [], []
    for path in sorted(SCANS.glob("*.obj")):
        try:
            measured = measure_mesh(_mesh(path))
        except ArgumentError:
            unusable.append(path.stem)
            measured = None
        for seed in SCAN_SEEDS:
            try:
                parameters, toward = _warp_scan(source, path, seed, measured)
            except ArgumentError as error:
                refused.append((path.stem, " ".join(str(error).split())))
                continue
            if measured is not None:
                errors = _errors(parameters, measured, measured.volume_m3, toward)
                found.append(dict(zip(REQUIRED, np.abs(errors), strict=True)))
    remark = f"{len(found)} samplings of scanned cups, truth from the free space in their meshes"
    for key, (required, unit) in REQUIRED_OF_SCANS.items():
        values = [errors[key] for errors in found]
        name = f"warping onto scans, median {key} error"
        yield at_most(name, float(np.median(values)), required, unit, remark)
    right = sum(name in unusable for name, _ in refused)
    wrong = len(refused) - right + (len(unusable) * len(SCAN_SEEDS) - right)
    reason = next((text.split(": expected ")[-1] for name, text in refused if name in unusable), "")
    name = "warping onto scans, wrongly refused or taken"
    yield at_most(name, wrong, 0, "scans", f"{', '.join(unusable)}: expected {reason}")


def _warp_scan(
    source: ObjectModel, path: Path, seed: int, measured: MeasuredMesh | None
) -> tuple[PouringParameters, np.ndarray]:
    """Parameters of a scanned mesh, and where the other container was said to be."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        target = load_target(path, n_points=2000, seed=seed)
    warped = warp_object(source, target.cloud)
    if target.surface is not None:
        check_wall(warped, target.surface)
    toward = BESIDE + (warped.rim.centre if measured is None else measured.opening_centre)
    return pouring_parameters(warped, toward), toward


def _mesh(path: Path) -> trimesh.Trimesh:
    """A scan's mesh, its vertices joined along the seams of the texture."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        mesh = trimesh.load_mesh(path)
        joined = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
        joined.merge_vertices(merge_tex=True, merge_norm=True)
    return joined


def _cloud(container: Container, seed: int, n_views: int) -> ObjectCloud:
    seen = scan(container.mesh, np.random.default_rng(seed), n_views)
    return ObjectCloud(seen.points, seen.normals)


def _errors(
    found: PouringParameters, truth: Container | MeasuredMesh, volume_m3: float, toward: np.ndarray
) -> tuple[float, ...]:
    """Errors of radius, volume and height in percent, of the tilt in degrees."""
    tilt = truth.tilt_reference_about(truth.lip_toward(toward))
    return (
        _percent(found.opening_radius_m, truth.opening_radius_m),
        _percent(found.volume_m3, volume_m3),
        _percent(found.height_m, truth.height_m),
        float(np.degrees(found.tilt_reference_rad - tilt)),
    )


def _percent(found: float, truth: float) -> float:
    return 100.0 * (found / truth - 1.0)
