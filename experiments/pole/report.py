# SPDX-License-Identifier: Apache-2.0
"""Report of the pole experiment: findings, figures, tables."""

import numpy as np

from experiments.draws import also, drawn, draws_tables
from experiments.pole.figures import PolePaths, components_figure, paths_figure, scene_figure
from experiments.pole.geometry import POLE_M, POLE_RADIUS_M, WAYS, fingertip
from experiments.pole.pictures import picture
from experiments.pole.study import PoleStudy
from experiments.results import Finding
from intent_recognition.array_types import Floats
from intent_recognition.report import Block, Figure, TableBlock, to_png, to_svg

PAPER_PLATEAU_CM = 4.0
"""Error of the path that the paper reaches with enough components [cm], about."""
TIP_ERROR = "error of the fingertip's path [cm]"
JOINT_ERROR = "error of the joints [rad]"


def findings(study: PoleStudy) -> tuple[Finding, ...]:
    """The paper's figures and ours, side by side."""
    single_m, taken_m = (study.tip_rms_m[k - 1] for k in (1, study.chosen))
    middle = float(np.median(drawn(study.draws, "path")))
    n = len(study.single.runs)
    single, mixture, single_end, end = (int(c.hits.sum()) for c in study.carried)
    taken = zip(study.mixture.indices, study.mixture.ways, strict=True)
    return (
        Finding.wanted(
            "error of the predicted path, leave-one-out [cm]",
            "about 4",
            f"{_one_sigma(taken_m)}{also(study.draws, 'path')}",
            middle <= PAPER_PLATEAU_CM,
            "A path on the other side counts in full.",
        ),
        Finding.alone(
            "... with a single Gaussian [cm]",
            f"{_one_sigma(single_m)}{also(study.draws, 'path, single')}",
            "The paper shows it in its Fig. 4 without a number.",
        ),
        Finding(
            "components",
            "sharp fall up to 6, 8 taken",
            f"sharp fall to {study.chosen}, {study.chosen} taken"
            f"{also(study.draws, 'components', 0)}",
            None,
            "With regularised covariances one component per side is enough; more have too few"
            " members each.",
        ),
        Finding(
            "motions of a single Gaussian that hit the pole",
            "several cross the middle",
            f"{single} of {n}; given the wand's end only {single_end} of {n}",
            True if single else None,
            "" if single else "None of this subset did.",
        ),
        *(
            Finding.wanted(name, "", f"{hits} of {n}", not hits, "They must not.")
            for name, hits in (
                (f"motions of {study.chosen} components that hit the pole", mixture),
                ("... given the wand's end only", end),
            )
        ),
        Finding.alone(
            "motions on the side that was shown",
            f"{sum(study.ways[i] == way for i, way in taken)} of {n}",
            "Not in the paper; at spots that are reached both ways either side is right.",
        ),
    )


def blocks(study: PoleStudy) -> tuple[Block, ...]:
    """Figures and tables."""
    return (_scene(study), _paths(study), _components(study), *_draws(study))


def shown_twice(study: PoleStudy) -> dict[str, int]:
    """The first spot that was shown on both sides: by way, the index of its demonstration."""
    spots = np.array([d.metadata["spot"] for d in study.demonstrations])
    for spot in spots:
        found = {study.ways[i]: int(i) for i in np.flatnonzero(spots == spot)}
        if len(found) == len(WAYS):
            return {way: found[way] for way in WAYS}
    return {}


def _scene(study: PoleStudy) -> Figure:
    images = [
        (f"by the robot's {way}", picture(study.pairs.controlled[index, -1]))
        for way, index in shown_twice(study).items()
    ]
    return Figure(
        to_png(scene_figure(images)),
        "One spot behind the pole, pointed at by either way, as in the paper's Fig. 2.",
    )


def _paths(study: PoleStudy) -> Figure:
    shown = fingertip(study.pairs.controlled)
    by_spot = {d.metadata["spot"]: k for k, d in enumerate(study.demonstrations)}
    first = sorted(by_spot.values())
    spots = shown[first, -1, :2]
    panels = [PolePaths("demonstrated", shown, study.ways, [False] * len(shown))]
    for carried, predicted, title in (
        (study.single, study.tried[0].predicted, "a single Gaussian"),
        (study.mixture, study.taken.predicted, f"{study.chosen} components"),
    ):
        paths = fingertip(predicted.mean[carried.indices])
        panels.append(PolePaths(title, paths, carried.ways, carried.hits.tolist()))
    figure = paths_figure(panels, spots, study.both[first], POLE_M, POLE_RADIUS_M)
    return Figure(
        to_svg(figure),
        "The fingertip from above, the robot below, the person on the far side: as demonstrated,"
        " and as predicted for each demonstration left out. The forearm follows the fingertip, so"
        " that the arm may hit the pole where the fingertip does not.",
    )


def _components(study: PoleStudy) -> Figure:
    numbers = [t.number for t in study.tried]
    errors = {
        TIP_ERROR: 100.0 * study.tip_rms_m,
        JOINT_ERROR: np.array([t.joint_rms_rad for t in study.tried]),
    }
    figure = components_figure(numbers, errors, study.chosen, {TIP_ERROR: PAPER_PLATEAU_CM})
    return Figure(
        to_svg(figure),
        "Root mean square error of the predicted motion over the number of components, each"
        " demonstration left out in turn. Where it rises again, components have one to four"
        " members, and some motions are predicted on the other side of the pole.",
    )


def _one_sigma(errors_m: Floats) -> str:
    """Mean ± standard deviation [cm]."""
    return f"{100.0 * errors_m.mean():.1f} ± {100.0 * errors_m.std(ddof=1):.1f}"


def _draws(study: PoleStudy) -> tuple[TableBlock, ...]:
    caption = (
        f"The {len(study.demonstrations)} recordings drawn again from other seeds, the shipped ones"
        " first: components taken, demonstrations in a component of their own side, error of the"
        " path, and planned motions that run through the pole, given the whole path of the wand or"
        " its end only; below median and range."
    )
    return draws_tables(study.draws, lambda name: "cm" if name.startswith("path") else "", caption)
