# SPDX-License-Identifier: Apache-2.0
"""Few, asynchronous, noisy observations (Maeda et al. 2014, Fig. 2).

One DOF of each agent. A ProMP is conditioned on the positions as they come. A DMP needs
accelerations, which three to ten irregular samples do not have; the best one can do is to lay a
smoothing spline through them and to differentiate that.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from experiments.results import ExperimentResult, Finding
from experiments.settings import Settings
from experiments.sketches.curves import PHASE, sketch_pairs
from experiments.sketches.differentiation import spline_operators
from experiments.sketches.models import learn_dmp, learn_promp, prior, standard_error
from experiments.sparse.conditioning import (
    NOISE_VARIANCE,
    choose_shrinkage,
    choose_splines,
    curves_of,
    observe,
    promp_curves,
    spline_choices,
    spline_predictor,
    true_acceleration,
)
from experiments.sparse.figures import Line, Panel, example_figure, sparse_error_figure
from experiments.sparse.study import (
    DMP_SPLINE,
    METHODS,
    N_TEST,
    N_TRAIN,
    NOTHING,
    PROMP,
    one_data_set,
)
from intent_recognition.array_types import Floats
from intent_recognition.report import Block, Figure, to_svg

STREAM_VARIANCE = 0.04
"""Of the noisy stream, as in the paper's Fig. 2 (b)."""
STREAM_SAMPLES = 61
EXAMPLE_COUNT = 4
"""Observations in the figure, as in the paper."""
EXAMPLE_PHASES = np.array([0.12, 0.3, 0.41, 0.78])


def run(settings: Settings) -> ExperimentResult:
    """Repeat on independent data sets: draw, choose, condition, score."""
    counts = (4, 10) if settings.quick else (3, 4, 6, 10)
    repeats = 2 if settings.quick else 10
    choices, scores = spline_choices(settings.quick), []
    for repeat in range(repeats):
        settings.progress(repeat / repeats, f"data set {repeat + 1} of {repeats}")
        scores.append(one_data_set(settings.rng(repeat), counts, choices))
    settings.progress(1.0, "figures")
    rmse = {m: np.array([s.rmse[m] for s in scores]) for m in METHODS}
    inside = np.array([s.inside for s in scores])
    acceleration = np.array([s.acceleration for s in scores])
    return ExperimentResult(
        title="Sparse, asynchronous, noisy observations",
        source="Maeda et al. 2014, Fig. 2",
        question=(
            "What do a few positions of one agent, at irregular times and with noise, say of both"
            " agents' movements, and can a DMP be conditioned on them at all?"
        ),
        findings=findings(counts, rmse, inside, acceleration),
        blocks=blocks(settings, counts, rmse),
        conditions=(
            "The paper's sketches are not published; ours are drawn by a generator.",
            "The noise of the sparse observations, which the paper does not report, has a standard"
            " deviation of 0.1 on curves that span 2 units and differ by 0.23.",
            "The paper says that the experiment cannot be done with a DMP; ours is given a"
            " smoothing spline, drawn out to the start, whose roughness, trust and shrinkage cross"
            " validation chooses for each number of observations.",
        ),
        numbers={
            "observations": list(counts),
            "rmse": {m: errors.mean(axis=0).tolist() for m, errors in rmse.items()},
            "rmse_standard_error": {
                m: standard_error(errors).tolist() for m, errors in rmse.items()
            },
            "inside_two_sigma": inside.mean(axis=0).tolist(),
            "acceleration_error": np.median(acceleration, axis=0).tolist(),
        },
    )


def findings(
    counts: Sequence[int], rmse: Mapping[str, Floats], inside: Floats, acceleration: Floats
) -> tuple[Finding, ...]:
    """The paper's figures and ours, side by side."""
    four = counts.index(EXAMPLE_COUNT)
    mean = {method: errors.mean(axis=0)[four] for method, errors in rmse.items()}
    share = 100.0 * inside[:, four].mean(axis=0)
    spline = 100.0 * np.median(acceleration[:, four], axis=0)
    ratio = mean[DMP_SPLINE] / mean[PROMP]
    drawn = "The paper shows one example and counts nothing; 95 % should lie inside."
    return (
        Finding.alone(
            "true curve of the observed agent within 2 sigma, four observations [%]",
            f"{share[0]:.1f}",
            drawn,
        ),
        Finding.alone("... of the controlled agent [%]", f"{share[1]:.1f}", drawn),
        Finding.alone(
            "RMSE of the controlled agent, four observations, in parts of that without any",
            f"{mean[PROMP] / mean[NOTHING]:.2f}",
            "The paper shows one example and gives no error.",
        ),
        Finding(
            "the same experiment with a DMP",
            "not possible",
            f"with a smoothing spline's accelerations, {ratio:.1f} times the ProMP's error",
            None,
            "It can be done, but a spline through four samples takes away"
            f" {100 * (1 - mean[DMP_SPLINE] / mean[NOTHING]):.0f} % of the error and the positions"
            f" themselves {100 * (1 - mean[PROMP] / mean[NOTHING]):.0f} %.",
        ),
        Finding.alone(
            "error of the acceleration from four observations [% of its root mean square]",
            f"{spline[1]:.0f} (spline through the samples: {spline[0]:.0f})",
            "The paper says that it is hard to compute.",
        ),
    )


def blocks(
    settings: Settings, counts: Sequence[int], rmse: Mapping[str, Floats]
) -> tuple[Block, ...]:
    """Figures, tables and remarks, in order."""
    rng = settings.rng(1000)
    train = sketch_pairs(rng, N_TRAIN)
    pair = sketch_pairs(rng, 1)[0]
    shrinkage = choose_shrinkage(rng, train, counts)
    choices = spline_choices(settings.quick)
    _, best = choose_splines(rng, train, EXAMPLE_COUNT, choices)
    _, best_ten = choose_splines(rng, train, 10, choices)
    promp, dmp = learn_promp(train), learn_dmp(train)
    before = curves_of(promp, prior(promp.parameters, shrinkage))
    at, ten = EXAMPLE_PHASES, np.linspace(0.05, 0.95, 10) + rng.uniform(-0.04, 0.04, 10)
    seen, seen_ten = observe(rng, pair[:, 0], at), observe(rng, pair[:, 0], ten)
    stream = PHASE[:STREAM_SAMPLES]
    streamed = observe(rng, pair[:, 0], stream, STREAM_VARIANCE)

    few = promp_curves(promp, shrinkage, at, seen)
    many = promp_curves(promp, shrinkage, stream, streamed, STREAM_VARIANCE)
    matrix, offset = spline_predictor(dmp, best, at)
    others = {DMP_SPLINE: matrix @ seen + offset}
    figure = example_figure(
        PHASE,
        (
            _example("(a) four observations", before, few, pair, (at, seen), others),
            _example("(b) a noisy stream", before, many, pair, (stream, streamed), None),
        ),
    )
    dense = np.linspace(max(at[0], ten[0]), min(at[-1], ten[-1]), 121)
    accelerations = {
        "true": true_acceleration(pair[:, 0], dense),
        "spline through four samples": spline_operators(at, dense, 0.0)[2] @ seen,
        "spline through ten samples": spline_operators(ten, dense, 0.0)[2] @ seen_ten,
        "best smoothing spline, ten samples": (
            spline_operators(ten, dense, best_ten.roughness)[2] @ seen_ten
        ),
    }
    lines = {m: Line(errors.mean(axis=0), standard_error(errors)) for m, errors in rmse.items()}
    return (
        Figure(
            to_svg(figure),
            "Prior (blue) and posterior (green) of both agents, \N{PLUS-MINUS SIGN} 2 standard"
            " deviations: (a) four observations at irregular times with noise of variance"
            f" {NOISE_VARIANCE:g}; (b) a stream with noise of variance {STREAM_VARIANCE:g} up to"
            " 60 % of the movement.",
        ),
        Figure(
            to_svg(sparse_error_figure(counts, lines, dense, accelerations)),
            f"Left: mean over {len(next(iter(rmse.values())))} data sets of {N_TEST} pairs,"
            " \N{PLUS-MINUS SIGN} 2 standard errors. Right: the acceleration in the example"
            " (a), and what a spline through four or ten observations of it says.",
        ),
    )


def _example(
    title: str,
    before: tuple[Floats, Floats],
    after: tuple[Floats, Floats],
    pair: Floats,
    seen: tuple[Floats, Floats],
    others: Mapping[str, Floats] | None,
) -> list[Panel]:
    return [
        Panel(
            "" if number else title,
            (before[0][number], before[1][number]),
            (after[0][number], after[1][number]),
            pair[:, number],
            None if number else seen,
            others if number else None,
        )
        for number in range(2)
    ]
