# SPDX-License-Identifier: Apache-2.0
"""Task constraints that carry over to other containers (Brandl et al. 2014, Fig. 3).

A classifier learns from 50 trials with one object when it pours, and when all that it pours ends
up in the second container; it is tested on the object's other trials and on nine other objects.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from experiments.constraints.features import (
    DIFFERENCE,
    LABEL,
    METHODS,
    POINT,
    STANDARD,
    STANDARDS,
    THROW,
    THROW_STANDARD,
    THROW_UPRIGHT,
    UPRIGHT,
    filling_samples,
    know_all,
    pouring_samples,
)
from experiments.constraints.figures import RocBand, RocPanel, roc_figure
from experiments.constraints.study import (
    N_TRAINING,
    NOVEL,
    SAME,
    ConstraintScores,
    CurveTable,
    score,
)
from experiments.constraints.trials import FILLING, POURING
from experiments.constraints.trials_file import TRIALS_FILE, Trials, read_trials
from experiments.results import ExperimentResult, Finding
from experiments.settings import Settings
from intent_recognition.report import Block, Column, Figure, Paragraph, TableBlock, to_svg
from intent_recognition.share import share_path
from sim_bridge.containers import CONTAINER_NAMES
from sim_bridge.scenarios.pouring import annotated_source

SETS_PER_OBJECT = 10
"""Training sets drawn for each object, over which scores are averaged."""


GAIN, AREA = 0.05, 0.95
"""Wanted gain in area of warped over standard features, and wanted area of label mapping."""


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
        findings=findings(trials, scores),
        blocks=blocks(scores),
        conditions=conditions(trials),
        numbers=numbers(trials, scores),
    )


def findings(trials: Trials, scores: Mapping[str, CurveTable]) -> tuple[Finding, ...]:
    """The paper's figures and ours, side by side."""
    through = sum(int(table["through_wall"].sum()) for table in trials.tables.values())
    pour = {method: by_test[NOVEL] for method, by_test in scores[POURING].items()}
    fill = {method: by_test[NOVEL] for method, by_test in scores[FILLING].items()}
    found = 100.0 * pour[LABEL].early.mean()
    warped = min(pour[LABEL].area, pour[POINT].area)
    return (
        Finding.wanted(
            "balls that went through a wall, all trials",
            "",
            str(through),
            through == 0,
            "The physics let balls through.",
        ),
        _area_finding(pour[LABEL].area),
        _gain_finding("pouring", warped - pour[STANDARD].area),
        _gain_finding("filling", min(fill[LABEL].area, fill[POINT].area) - fill[STANDARD].area),
        _gain_finding(
            "filling, how far is thrown learned too, best standard features",
            fill[THROW].area - max(fill[m].area for m in STANDARDS),
        ),
        Finding.wanted(
            "pouring trials found with 1 % false positives, novel objects, label mapping [%]",
            "more than 50 with almost no false positives",
            f"{found:.0f}",
            found > 50.0,
            "Balls are coarser than the paper's fluid.",
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
    return Finding.wanted(
        f"pouring: area of label mapping on novel objects (at least {AREA:g})",
        "drawn, not given",
        f"{area:.3f}",
        area >= AREA,
        f"{AREA:g} is asked for.",
    )


def _gain_finding(name: str, gain: float) -> Finding:
    return Finding.wanted(
        f"{name}: area of warped less standard features, novel objects (at least {GAIN:g})",
        "clearly better",
        f"{gain:+.3f}",
        gain >= GAIN,
        f"At least {GAIN:g} is asked for.",
    )


def blocks(scores: Mapping[str, CurveTable]) -> tuple[Block, ...]:
    """Figures, tables and remarks, in order."""
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
        Paragraph(_filling_remark(scores[FILLING])),
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


def _area_table(scores: Mapping[str, CurveTable]) -> TableBlock:
    columns = (
        Column("experiment", align="left"),
        Column("features", align="left"),
        Column("area, same object", form=".3f"),
        Column("area, novel objects", form=".3f"),
        Column("worst training set", form=".3f"),
        Column("found with 1 % false positives, novel", "%", form=".0f"),
    )
    rows = []
    for name, by_method in scores.items():
        for method, by_test in by_method.items():
            novel = by_test[NOVEL]
            areas = by_test[SAME].area, novel.area, novel.areas.min()
            rows.append((name, method, *areas, 100 * novel.early.mean()))
    return TableBlock(columns, rows, "Areas below the ROC curves, means over the training sets.")


def conditions(trials: Trials) -> tuple[str, ...]:
    """What differs from the paper, one sentence each."""
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


def numbers(trials: Trials, scores: Mapping[str, CurveTable]) -> dict[str, object]:
    """All numbers of the experiment, ready for JSON."""
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
