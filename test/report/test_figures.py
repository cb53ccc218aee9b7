# SPDX-License-Identifier: Apache-2.0
"""Figures hold what they were given, stand alone, and leave nothing behind."""

import sys
import xml.etree.ElementTree as ElementTree

import matplotlib
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from intent_recognition.evaluation.calibration import confusion_counts, reliability_bins
from intent_recognition.report import figures_session as figures
from intent_recognition.report.drawing import (
    NONE_COLOUR,
    PALETTE,
    task_colours,
    task_markers,
    to_svg,
)
from intent_recognition.report.figures_evaluation import (
    confusion_shares_figure,
    coverage_figure,
    recognition_figure,
    reliability_figure,
    rmse_figure,
)
from intent_recognition.report.figures_interaction import (
    posterior_over_time_figure,
    thin,
    transfer_figure,
)

RELAXED = settings(deadline=None, max_examples=40, suppress_health_check=[HealthCheck.too_slow])
TASKS = ("hold", "plate", "screw")
FRACTIONS = [0.25, 0.5, 0.75, 1.0]


def arrivals(per_task, labels=()):
    return figures.histogram_figure(per_task, "arrival [s]", 0.0, "{:+.2f} s", labels)


@pytest.fixture
def per_task(rng):
    return {task: list(rng.uniform(0.1, 0.9, 12)) for task in TASKS}


@pytest.fixture
def trace(rng):
    share = np.linspace(0.0, 1.1, 900)
    return {
        "index": 1,
        "labels": [*TASKS, "none"],
        "share": share,
        "probabilities": rng.dirichlet(np.ones(4), share.size),
        **{f"{what}_s": share for what in ("person", "transfer")},
        **{f"{what}_n": rng.uniform(0.0, 9.0, share.size) for what in ("person", "load", "grip")},
        "load_share": share / 2.0,
        "decision_s": 0.7,
        "end_s": 2.0,
    }


@pytest.fixture
def all_figures(per_task, trace, rng):
    series = {"known_phase": (FRACTIONS, [0.2, 0.1, np.nan, 0.1])}
    share = np.linspace(0.0, 1.0, 30)
    posterior = rng.dirichlet(np.ones(4), 30)
    return {
        "hand_error": figures.hand_error_figure(per_task, {"plate": (3.2, 2.6)}, {"screw": "x"}),
        "arrival": arrivals(per_task),
        "posterior": figures.posterior_figure(
            ["plate", "screw"], [*TASKS, "none"], [share] * 2, [posterior] * 2, [0.4, None]
        ),
        "confusion": confusion_shares_figure(np.eye(3, 4), TASKS, ("$^$", *TASKS[1:], "none")),
        "transfer": transfer_figure(trace),
        "over_time": posterior_over_time_figure(trace, 2.0),
        "recognition": recognition_figure(series, series),
        "rmse": rmse_figure({"known_phase": {"rmse": (FRACTIONS, FRACTIONS)}}, "rad"),
        "coverage": coverage_figure(series),
        "reliability": reliability_figure(*reliability_bins(posterior.ravel(), np.ones(120))),
    }


@pytest.mark.slow
def test_every_figure_draws_labels_its_axes_and_is_never_registered(all_figures):
    for name, figure in all_figures.items():
        root = ElementTree.fromstring(to_svg(figure))
        assert root.tag.endswith("svg"), name
        assert sum(1 for _ in root.iter("{http://www.w3.org/2000/svg}path")) > 10, name
        shown = [axes for axes in figure.axes if axes.axison]
        assert any(axes.get_xlabel() for axes in shown) or name == "hand_error"
        assert any(axes.get_ylabel() for axes in shown), name
    if "matplotlib.pyplot" in sys.modules:
        assert sys.modules["matplotlib.pyplot"].get_fignums() == []


def test_equal_figures_give_equal_bytes_without_date_whatever_the_users_settings(per_task):
    plain = to_svg(arrivals(per_task))
    assert b"<metadata" not in plain and b"DOCTYPE" not in plain
    with matplotlib.rc_context({"font.size": 31.0, "axes.facecolor": "red"}):
        assert to_svg(arrivals(per_task)) == plain
        assert matplotlib.rcParams["font.size"] == 31.0


def test_hand_errors_and_whiskers_are_where_they_belong():
    errors = [1.0, 2.0, 3.0, 6.0]
    figure = figures.hand_error_figure({"plate": errors}, {"plate": (3.2, 2.6)})
    axes = figure.axes[0]
    assert sorted(axes.collections[0].get_offsets()[:, 1]) == errors
    centres = [container.lines[0].get_ydata()[0] for container in axes.containers]
    assert centres == [3.0, 3.2]
    segments = [container.lines[2][0].get_segments()[0][:, 1] for container in axes.containers]
    spread = 2 * np.std(errors, ddof=1)
    np.testing.assert_allclose(segments[0], [max(0.0, 3.0 - spread), 3.0 + spread])
    np.testing.assert_allclose(segments[1], [0.6, 5.8])


@pytest.mark.slow
def test_nothing_measured_still_draws():
    nothing = {"plate": []}
    for figure in (figures.hand_error_figure(nothing), arrivals(nothing)):
        assert to_svg(figure)


def test_the_bar_of_a_single_value_is_wide_enough_to_be_seen():
    axes = arrivals({"plate": [2.8]}).axes[0]
    assert min(bar.get_width() for bar in axes.patches) > 0.02 * np.ptp(axes.get_xlim())


def test_what_is_predicted_and_decided_has_the_colour_of_no_task(trace):
    lines = {line.get_color() for line in transfer_figure(trace).axes[0].lines}
    assert len(lines) > 1 and not lines & set(PALETTE)
    assert len(transfer_figure(trace | {"load_share": np.zeros(900)}).axes) == 1  # none is offered
    posterior = posterior_over_time_figure(trace, 2.0).axes[0].lines
    assert [line.get_color() in PALETTE for line in posterior] == 3 * [True] + 3 * [False]


def test_a_task_has_its_colour_where_the_others_did_not_happen(per_task):
    one = {"plate": per_task["plate"]}
    own = matplotlib.colors.to_rgba(task_colours(TASKS)["plate"])
    bars = arrivals(one, TASKS).axes[0].patches
    assert {bar.get_facecolor() for bar in bars} == {own}
    figure = figures.hand_error_figure(one, labels=TASKS)
    (colour, *_) = figure.axes[0].collections[0].get_facecolor()
    assert tuple(colour[:3]) == own[:3]


@RELAXED
@given(st.sets(st.sampled_from("abcdefgh"), min_size=1), st.randoms())
def test_colours_and_markers_depend_on_the_sorted_labels_alone(labels, random):
    shuffled = [*labels, "none"]
    random.shuffle(shuffled)
    colours = task_colours(shuffled)
    assert colours == task_colours(sorted(labels))
    assert [colours[label] for label in sorted(labels)] == list(PALETTE[: len(labels)])
    assert colours["none"] == NONE_COLOUR
    assert len(set(task_markers(shuffled).values())) == len(labels) + 1


@RELAXED
@given(st.sets(st.sampled_from("abcdefgh"), min_size=1), st.sets(st.sampled_from("abcdefgh")))
def test_known_tasks_keep_their_colours_and_no_two_have_the_same(labels, more):
    earlier = task_colours(labels)
    colours = task_colours(labels | more, earlier)
    assert colours == colours | earlier
    assert len(set(colours.values())) == len(labels | more) + 1


@RELAXED
@given(st.lists(st.tuples(st.sampled_from(TASKS), st.sampled_from((*TASKS, "none", "")))))
def test_confusion_counts_every_pair(pairs):
    true, recognised = [t for t, _ in pairs], [r for _, r in pairs]
    rows, columns, counts = confusion_counts(true, recognised)
    assert counts.sum() == len(pairs)
    for row, task in enumerate(rows):
        for column, name in enumerate(columns):
            assert counts[row, column] == sum(t == task and (r or "none") == name for t, r in pairs)


@RELAXED
@given(st.lists(st.tuples(st.floats(0.0, 1.0), st.booleans()), min_size=1, max_size=50))
def test_reliability_bins_conserve_mass(pairs):
    probabilities, truth = (np.array(values, dtype=float) for values in zip(*pairs, strict=True))
    mean, share, counts = reliability_bins(probabilities, truth)
    used = counts > 0
    assert counts.sum() == len(pairs)
    assert np.sum(mean[used] * counts[used]) == pytest.approx(probabilities.sum())
    assert np.sum(share[used] * counts[used]) == pytest.approx(truth.sum())
    edges = np.arange(10) / 10
    assert np.all(mean[used] >= edges[used] - 1e-12)
    assert np.all(mean[used] <= edges[used] + 0.1 + 1e-12)


def test_histograms_hold_every_interaction(per_task):
    per_task["plate"].append(1.7)
    bars = arrivals(per_task).axes[0].patches
    assert sum(bar.get_height() for bar in bars) == sum(map(len, per_task.values()))


def test_thinning_keeps_both_ends():
    values = np.arange(10_000)
    assert thin(values, 100)[[0, -1]].tolist() == [0, 9999]
    assert len(thin(values, 100)) == 100
    assert thin(values[:7], 100) is not None
    assert len(thin(values[:7], 100)) == 7
