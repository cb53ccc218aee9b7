# SPDX-License-Identifier: Apache-2.0
"""Report of the pole experiment: findings, figures, tables."""

import numpy as np
from numpy.typing import NDArray

from experiments.draws import also, drawn, draws_tables
from experiments.left_out import FINAL, PHASES, predict
from experiments.pole.figures import (
    PolePaths,
    clearance_figure,
    components_figure,
    paths_figure,
    scene_figure,
    two_answers_figure,
)
from experiments.pole.geometry import POLE_M, POLE_RADIUS_M, WAYS, fingertip, way_of
from experiments.pole.study import Carried, PoleStudy, n_through
from experiments.results import Finding
from intent_recognition.kinematics import JOINT_NAMES
from intent_recognition.learning import purity
from intent_recognition.report import (
    Block,
    Column,
    Figure,
    KeyNumber,
    KeyNumbers,
    Paragraph,
    TableBlock,
    to_png,
    to_svg,
)

PAPER_PLATEAU_CM = 4.0
"""Error of the path that the paper reaches with enough components [cm], about."""
SHOWN_JOINTS = (0, 2, 4)
"""Joints that are drawn, by index."""
TIP_ERROR = "error of the fingertip's path [cm]"
JOINT_ERROR = "error of the joints [rad]"


def findings(study: PoleStudy) -> tuple[Finding, ...]:
    """The paper's figures and ours, side by side."""
    single_m, taken_m = (study.tip_rms_m[k - 1] for k in (1, study.chosen))
    middle = float(np.median(drawn(study.draws, "path")))
    n = len(study.single.runs)
    single, mixture, single_end, end = (int(c.hits.sum()) for c in study.carried)
    same = sum(a == study.ways[i] for a, i in _ways(study.mixture))
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
            f"{single} of {n}; told the wand's end only {single_end} of {n}",
            True if single else None,
            "" if single else "None of this subset did.",
        ),
        *(
            Finding.wanted(name, "", f"{hits} of {n}", not hits, "They must not.")
            for name, hits in (
                (f"motions of {study.chosen} components that hit the pole", mixture),
                ("... told the wand's end only", end),
            )
        ),
        Finding.alone(
            "motions on the side that was shown",
            f"{same} of {n}",
            "Not in the paper; at spots that are reached both ways either side is right.",
        ),
    )


def blocks(study: PoleStudy) -> tuple[Block, ...]:
    """Figures and tables."""
    return (
        _key_numbers(study),
        _scene(study),
        _paths(study),
        _components(study),
        _table(study),
        _clearance(study),
        *_draws(study),
        *_two_answers(study),
    )


def _ways(carried: Carried) -> list[tuple[str, int]]:
    return list(zip(carried.ways, carried.indices.tolist(), strict=True))


def _key_numbers(study: PoleStudy) -> KeyNumbers:
    error = 100.0 * study.tip_rms_m[study.chosen - 1].mean()
    n = len(study.mixture.runs)
    hits = int(study.mixture.hits.sum())
    found = purity(list(study.ways), study.taken.labels)
    return KeyNumbers(
        (
            KeyNumber("components chosen", str(study.chosen), "8"),
            KeyNumber(
                "error of the path", f"{error:.1f} cm", "about 4 cm", error <= PAPER_PLATEAU_CM
            ),
            KeyNumber("hit the pole", f"{hits} of {n}", good=not hits),
            KeyNumber("a single Gaussian hits it", f"{int(study.single.hits.sum())} of {n}"),
            KeyNumber("purity of the components", f"{found:.2f}", note="by the side of the pole"),
        )
    )


def shown_twice(study: PoleStudy) -> dict[str, int]:
    """The first spot that was shown on both sides: by way, the index of its demonstration."""
    spots = np.array([d.metadata["spot"] for d in study.demonstrations])
    for spot in spots:
        found = {study.ways[i]: int(i) for i in np.flatnonzero(spots == spot)}
        if len(found) == len(WAYS):
            return {way: found[way] for way in WAYS}
    return {}


def _scene(study: PoleStudy) -> Figure:
    from experiments.pole.pictures import picture

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


def _table(study: PoleStudy) -> TableBlock:
    columns = (
        Column("components"),
        Column("left-out density", "nats per sample, lower is better", form=".2f"),
        Column("path", "cm"),
        Column("joints", "rad", form=".3f"),
        Column("on the other side"),
        Column("... at spots reached one way"),
        Column("through the pole"),
    )
    rows = []
    for tried, tip_rms_m in zip(study.tried, study.tip_rms_m, strict=True):
        predicted = [way_of(path) for path in fingertip(tried.predicted.mean)]
        other = np.array([a != b for a, b in zip(predicted, study.ways, strict=True)])
        errors = tried.nll.mean(), _one_sigma(tip_rms_m), tried.joint_rms_rad.mean()
        others = other.sum(), (other & ~study.both).sum()
        rows.append((tried.number, *errors, *others, n_through(tried.predicted)))
    return TableBlock(columns, rows, "Predictions, before execution.", strong=[study.chosen - 1])


def _one_sigma(errors_m: NDArray[np.float64]) -> str:
    """Mean ± standard deviation [cm]."""
    return f"{100.0 * errors_m.mean():.1f} ± {100.0 * errors_m.std(ddof=1):.1f}"


def _draws(study: PoleStudy) -> tuple[TableBlock, ...]:
    caption = (
        f"The {len(study.demonstrations)} recordings drawn again from other seeds, the shipped ones"
        " first: components taken, demonstrations in a component of their own side, error of the"
        " path, and planned motions that run through the pole, told the whole path of the wand or"
        " its end only; below median and range."
    )
    return draws_tables(study.draws, lambda name: "cm" if name.startswith("path") else "", caption)


def _clearance(study: PoleStudy) -> Figure:
    shown = np.array([float(d.metadata["clearance_m"]) for d in study.demonstrations])
    kinds: dict[str, tuple[NDArray[np.float64], NDArray[np.bool_]]] = {
        "demonstrated": (shown, np.zeros(len(shown), dtype=bool))
    }
    for carried in study.carried:
        kinds[carried.label] = carried.clearance_m, carried.hits
    return Figure(
        to_svg(clearance_figure(kinds)),
        "Least distance of the arm and its finger from the pole, in physics: demonstrated, and"
        " executed from predictions of each demonstration left out; red: it touched. An arm that"
        " the pole holds up presses against it, at a distance of about zero, however deep it was"
        " told to go.",
    )


def _two_answers(study: PoleStudy) -> tuple[Block, ...]:
    """What is predicted at one spot that was shown on both sides, from where the wand ends."""
    if study.chosen < 2:
        return ()
    twice = shown_twice(study)
    index, n = twice[WAYS[0]], len(study.demonstrations)
    labels = study.taken.labels
    answers = []
    for way in WAYS:
        members = labels[np.array(study.ways) == way]
        component = int(np.bincount(members).argmax())
        found = predict(study.pairs, study.taken.mixtures, FINAL, np.full(n, component))
        chance = found.probability[index, component]
        answers.append(
            (f"component {way}, p = {chance:.2f}", *_drawn(found.mean[index], found.std[index]))
        )
    single = predict(study.pairs, study.tried[0].mixtures, FINAL)
    answers.append(("single Gaussian", *_drawn(single.mean[index], single.std[index])))
    truths = {way: study.pairs.controlled[i][:, SHOWN_JOINTS] for way, i in twice.items()}
    names = [JOINT_NAMES[q].removesuffix("_joint") for q in SHOWN_JOINTS]
    other = sum(a != study.ways[i] for a, i in _ways(study.mixture_end))
    off = sum(a != study.ways[i] and not study.both[i] for a, i in _ways(study.mixture_end))
    return (
        Figure(
            to_svg(two_answers_figure(PHASES, answers, truths, names)),
            "What the wand's final position says about the arm at one spot that was shown on both"
            " sides (the one by the left was left out): two answers, ± 2 sigma, and the single"
            " Gaussian between them.",
        ),
        Paragraph(
            f"Told the final position only, nothing says the side at such spots: {other} of"
            f" {len(study.mixture_end.runs)} motions go by the other side than was shown, {off} of"
            " them at spots that are reached one way only. The fingertip ends"
            f" {100 * study.mixture_end.final_error_m.mean():.1f} cm from where it was shown to, on"
            f" average (at most {100 * study.mixture_end.final_error_m.max():.1f} cm), whatever the"
            " side."
        ),
    )


def _drawn(
    mean: NDArray[np.float64], std: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    return mean[:, SHOWN_JOINTS], std[:, SHOWN_JOINTS]
