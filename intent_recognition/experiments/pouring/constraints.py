# SPDX-License-Identifier: Apache-2.0
"""Task constraints that carry over to other containers (Brandl et al. 2014, Fig. 3).

A classifier learns from 50 trials with one object when it pours, and when all that it pours ends
up in the second container; it is tested on the object's other trials and on nine other objects.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from intent_recognition.errors import TrainingError
from intent_recognition.evaluation import on_grid, roc_curve
from intent_recognition.experiments.pouring.constraint_features import (
    LABEL,
    METHODS,
    POINT,
    STANDARD,
    Samples,
    annotated_source,
    filling_samples,
    know_all,
    pouring_samples,
)
from intent_recognition.experiments.pouring.figures_constraints import RocBand, RocPanel, roc_figure
from intent_recognition.experiments.settings import Settings
from intent_recognition.report import (
    Block,
    Column,
    ExperimentResult,
    Figure,
    Finding,
    Table,
    Text,
    to_svg,
)
from intent_recognition.share import share_path
from intent_recognition.warping import RIDGE, FillingConstraint, fit_logistic, landing
from sim_bridge.balls import FILLING, POURING, Trials, read_trials
from sim_bridge.containers import CONTAINER_NAMES

TRIALS_FILE = "config/pouring_trials.npz"
N_TRAINING = 50
"""Trials that a classifier learns from, as in the paper."""
SETS_PER_OBJECT = 10
FEW_FALSE_POSITIVES = 0.01
GAIN, AREA = 0.05, 0.95
"""By how much warped features are to beat standard ones, and what label mapping is to reach."""

DIFFERENCE, THROW = "label mapping, tilt less reference", "label mapping, and the throw"
THROW_STANDARD = "standard, and the throw of a usual cup"
UPRIGHT = "standard, centres of upright cups"
THROW_UPRIGHT = "standard, upright, and the throw of a usual cup"
STANDARDS = (STANDARD, UPRIGHT, THROW_STANDARD, THROW_UPRIGHT)
"""Ways to do without references in filling."""

SAME, NOVEL = "same object", "novel objects"


class ConstraintScores(NamedTuple):
    """Of one method on one test set, over M training sets.

    Attributes:
        curves: true positive rates on the grid (M, G).
        areas: below the curves (M,).
        early: true positive rate at `FEW_FALSE_POSITIVES` (M,).
        trained_on: index of the training object (M,).
    """

    curves: NDArray[np.float64]
    areas: NDArray[np.float64]
    early: NDArray[np.float64]
    trained_on: NDArray[np.float64]

    @property
    def area(self) -> float:
        """Mean area."""
        return float(self.areas.mean())


ScoreTable = Mapping[str, Mapping[str, ConstraintScores]]
"""Scores by method and test set (`SAME`, `NOVEL`)."""


def run(settings: Settings) -> ExperimentResult:
    """Score three kinds of features in both experiments."""
    path = share_path(TRIALS_FILE) if settings.bags is None else settings.bags / Path(TRIALS_FILE)
    trials = read_trials(path)
    settings.progress(0.0, "warping the mug onto the other containers")
    known = know_all(annotated_source(), settings.rng(1), range(len(CONTAINER_NAMES)))
    sheets = {
        POURING: {method: pouring_samples(trials, known[method]) for method in METHODS},
        FILLING: {method: filling_samples(trials, known[method]) for method in METHODS},
    }
    sheets[POURING][DIFFERENCE] = pouring_samples(trials, known[LABEL], difference=True)
    sheets[FILLING][THROW] = filling_samples(trials, known[LABEL], throw=True)
    for upright, name, thrown in (
        (False, STANDARD, THROW_STANDARD),
        (True, UPRIGHT, THROW_UPRIGHT),
    ):
        sheets[FILLING][name] = filling_samples(trials, known[STANDARD], upright=upright)
        sheets[FILLING][thrown] = filling_samples(
            trials, known[STANDARD], upright=upright, throw=True
        )
    n_sets = 1 if settings.quick else SETS_PER_OBJECT
    scores: dict[str, dict[str, dict[str, ConstraintScores]]] = {POURING: {}, FILLING: {}}
    todo = [(name, method) for name, sheet in sheets.items() for method in sheet]
    for done, (name, method) in enumerate(todo):
        settings.progress(0.2 + 0.8 * done / len(todo), f"{name}, {method}")
        # The same training sets for every method.
        stream = 2 if name == POURING else 3
        scores[name][method] = score(sheets[name][method], n_sets, settings.rng(stream))
    settings.progress(1.0, "figure")
    return ExperimentResult(
        title="Task constraints that carry over to other containers",
        source="Brandl et al. 2014, Fig. 3",
        question=(
            "What 50 trials with one cup tell of when it pours, and of when all of it ends up in"
            " the second container: does it hold for nine other cups and bowls?"
        ),
        findings=_findings(trials, scores),
        blocks=_blocks(scores),
        conditions=_conditions(trials),
        numbers=_numbers(trials, scores),
    )


def score(samples: Samples, n_sets: int, rng: np.random.Generator) -> dict[str, ConstraintScores]:
    """Learn from `n_sets` training sets per object; test on its other trials and on the others.

    Raises:
        TrainingError: the trials of one object all have the same label.
    """
    rows: dict[str, list[tuple[NDArray[np.float64], float, float, int]]] = {SAME: [], NOVEL: []}
    for index in np.unique(samples.objects):
        own = np.flatnonzero(samples.objects == index)
        others = np.flatnonzero(samples.objects != index)
        if len(np.unique(samples.labels[own])) < 2:
            raise TrainingError(f"{CONTAINER_NAMES[index]}: all of its trials have one label.")
        for _ in range(n_sets):
            shuffled = _both_labels_first(own, samples.labels, rng)
            train, rest = shuffled[:N_TRAINING], shuffled[N_TRAINING:]
            log_odds = _learned(samples, train)
            for name, test in ((SAME, rest), (NOVEL, others)):
                odds = log_odds(test)
                curve = roc_curve(odds, samples.labels[test])
                early = on_grid(curve, np.array([FEW_FALSE_POSITIVES]))[0]
                rows[name].append((on_grid(curve), curve.area, float(early), int(index)))
    return {
        name: ConstraintScores(*map(np.array, zip(*row, strict=True))) for name, row in rows.items()
    }


def _learned(
    samples: Samples, train: NDArray[np.integer]
) -> Callable[[NDArray[np.integer]], NDArray[np.float64]]:
    """Log odds of rows (n,), learned from the rows `train`."""
    features, labels, unit = samples.features, samples.labels, samples.unit_throw
    if unit is None:
        model = fit_logistic(features[train], labels[train], ridge=RIDGE)
        return lambda rows: model.log_odds(features[rows])
    filling = FillingConstraint.learn_throw(features[train], unit[train], labels[train])
    return lambda rows: filling.model.log_odds(landing(features[rows], filling.throw * unit[rows]))


def _both_labels_first(
    rows: NDArray[np.integer], labels: NDArray[np.float64], rng: np.random.Generator
) -> NDArray[np.integer]:
    """Rows in random order, with both labels in the training part and in the rest."""
    while True:
        shuffled = rng.permutation(rows)
        seen, rest = labels[shuffled[:N_TRAINING]], labels[shuffled[N_TRAINING:]]
        if 0.0 < seen.mean() < 1.0 and 0.0 < rest.mean() < 1.0:
            return shuffled


def _findings(trials: Trials, scores: Mapping[str, ScoreTable]) -> tuple[Finding, ...]:
    through = sum(int(table["through_wall"].sum()) for table in trials.tables.values())
    pour = {method: by_test[NOVEL] for method, by_test in scores[POURING].items()}
    fill = {method: by_test[NOVEL] for method, by_test in scores[FILLING].items()}
    found = 100.0 * pour[LABEL].early.mean()
    warped = min(pour[LABEL].area, pour[POINT].area)
    return (
        Finding(
            "balls that went through a wall, all trials",
            "",
            str(through),
            through == 0,
            "" if through == 0 else "The physics let balls through.",
        ),
        _area_finding(pour[LABEL].area),
        _gain_finding("pouring", warped - pour[STANDARD].area),
        _gain_finding("filling", min(fill[LABEL].area, fill[POINT].area) - fill[STANDARD].area),
        _gain_finding(
            "filling, how far is thrown learned too, best standard features",
            fill[THROW].area - max(fill[m].area for m in STANDARDS),
        ),
        Finding(
            "pouring trials found with 1 % false positives, novel objects, label mapping [%]",
            "more than 50 with almost no false positives",
            f"{found:.0f}",
            bool(found > 50.0),
            "" if found > 50.0 else "Balls are coarser than the paper's fluid.",
        ),
        Finding(
            "pouring: area of label mapping less that of point mapping, novel objects",
            "label mapping is better",
            f"{pour[LABEL].area - pour[POINT].area:+.3f}",
            None,
            "Our annotated mug has as many points as a scan, 2000; the paper's has fewer.",
        ),
    )


def _area_finding(area: float) -> Finding:
    holds = bool(area >= AREA)
    remark = "" if holds else f"{AREA:g} is asked for."
    return Finding(
        f"pouring: area of label mapping on novel objects (at least {AREA:g})",
        "drawn, not given",
        f"{area:.3f}",
        holds,
        remark,
    )


def _gain_finding(name: str, gain: float) -> Finding:
    holds = bool(gain >= GAIN)
    remark = "" if holds else f"At least {GAIN:g} is asked for."
    return Finding(
        f"{name}: area of warped less standard features, novel objects (at least {GAIN:g})",
        "clearly better",
        f"{gain:+.3f}",
        holds,
        remark,
    )


def _blocks(scores: Mapping[str, ScoreTable]) -> tuple[Block, ...]:
    panels = [
        [
            RocPanel(f"{name}, {test}", {m: _band(scores[name][m][test]) for m in METHODS})
            for test in (SAME, NOVEL)
        ]
        for name in (POURING, FILLING)
    ]
    count = len(scores[POURING][LABEL][NOVEL].areas)
    return (
        Figure(
            to_svg(roc_figure(panels)),
            f"Mean and quartiles over {count} training sets of {N_TRAINING} trials with one"
            " object each. Left: the object's other trials. Right: nine other objects.",
        ),
        _area_table(scores),
        _object_table(scores),
        Text(_filling_remark(scores[FILLING])),
    )


def _filling_remark(filling: Mapping[str, Mapping[str, ConstraintScores]]) -> str:
    area = {method: by_test[NOVEL].area for method, by_test in filling.items()}
    return (
        "The paper defines relative positions by the objects' centres. From the centres of the cups"
        f" as they are tilted standard features reach {area[STANDARD]:.3f} on novel objects, from"
        " the centres of the same cups stood upright at the same lip"
        f" {area[UPRIGHT]:.3f}, the paper's warped features {area[LABEL]:.3f}: the second container"
        " is always the same, so its reference values cannot help here. What leaves a tall cup is"
        " faster and flies farther than what leaves a bowl, which ratios of single lengths do not"
        " say. With distances taken to where it lands, a learned number times sqrt(height of the"
        " cup x height above the opening) ahead of the lip, the area is"
        f" {area[THROW]:.3f}; standard"
        f" features that take every cup to be as tall reach {area[THROW_STANDARD]:.3f} and"
        f" {area[THROW_UPRIGHT]:.3f} in the same way."
    )


def _band(scores: ConstraintScores) -> RocBand:
    low, high = np.quantile(scores.curves, (0.25, 0.75), axis=0)
    return RocBand(scores.curves.mean(axis=0), low, high, scores.area)


def _area_table(scores: Mapping[str, ScoreTable]) -> Table:
    rows = tuple(
        (
            name,
            method,
            *(f"{by_test[t].area:.3f}" for t in (SAME, NOVEL)),
            f"{by_test[NOVEL].areas.min():.3f}",
            f"{100 * by_test[NOVEL].early.mean():.0f}",
        )
        for name, by_method in scores.items()
        for method, by_test in by_method.items()
    )
    columns = (
        Column("experiment", align="left"),
        Column("features", align="left"),
        Column("area, same object"),
        Column("area, novel objects"),
        Column("worst training set"),
        Column("found with 1 % false positives, novel", "%"),
    )
    return Table(columns, rows, "Areas below the ROC curves, means over the training sets.")


def _object_table(scores: Mapping[str, ScoreTable]) -> Table:
    def cell(by_test: Mapping[str, ConstraintScores], index: int) -> str:
        own = by_test[NOVEL].trained_on == index
        return f"{by_test[NOVEL].areas[own].mean():.3f}"

    rows = tuple(
        (
            name.replace("_", " "),
            *(cell(scores[e][m], index) for e in (POURING, FILLING) for m in METHODS),
        )
        for index, name in enumerate(CONTAINER_NAMES)
    )
    columns = (
        Column("learned from", align="left"),
        *(Column(f"{e}, {m}") for e in (POURING, FILLING) for m in METHODS),
    )
    return Table(columns, rows, "Area on the nine other objects, by the object learned from.")


def _conditions(trials: Trials) -> tuple[str, ...]:
    pouring, filling = (
        len(trials.tables[name]["object"]) // len(CONTAINER_NAMES) for name in (POURING, FILLING)
    )
    return (
        "Balls without friction stand for the fluid, 60 of them fill a container;"
        f" {pouring} pouring and {filling} filling trials per object.",
        "Gravity turns instead of the container, up to 90 degrees in the pouring trials.",
        "What is poured flies into the second container from where it left the first; the two"
        " containers themselves do not touch.",
        "Ten made cups and bowls, each scanned from three views with noise; the one annotated"
        " object is a mug of another size.",
        "The second container of the filling trials is the tea cup.",
        "Squares of the horizontal distances are features of all methods: what is linear in a"
        " distance has no middle.",
        "Standard features measure to the centres of the objects as they stand when pouring.",
    )


def _numbers(trials: Trials, scores: Mapping[str, ScoreTable]) -> dict[str, object]:
    return {
        "n_trials": {name: len(table["object"]) for name, table in trials.tables.items()},
        "positive": {
            POURING: float(np.mean(trials.tables[POURING]["poured"] > 0.0)),
            FILLING: float(np.mean(trials.tables[FILLING]["success"])),
        },
        "through_wall": {
            name: int(table["through_wall"].sum()) for name, table in trials.tables.items()
        },
        "areas": {
            name: {m: {t: s.area for t, s in by_test.items()} for m, by_test in by_method.items()}
            for name, by_method in scores.items()
        },
    }
