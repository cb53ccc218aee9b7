# SPDX-License-Identifier: Apache-2.0
"""What `.plot()` draws is what the numbers say."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib import pyplot

import intent_recognition as ir


def reach(rng, place):
    times_s = np.arange(0.0, 2.0, 0.02)
    way = np.clip((times_s - 0.4) / 1.2, 0.0, 1.0) ** 2 * (place + 0.05 * rng.normal())
    human = np.stack([way, 0.5 * way], axis=1) + 0.001 * rng.normal(size=(100, 2))
    return times_s, human, np.stack([1.0 - way, 0.3 * way], axis=1)


@pytest.fixture(scope="module")
def library():
    rng = np.random.default_rng(0)
    demonstrations = (
        ir.Demonstration.from_arrays(*reach(rng, place), task=task, controlled_unit="rad")
        for task, place in (("near", 0.3), ("far", 0.7))
        for _ in range(6)
    )
    return ir.learn(demonstrations, ir.TrainingSettings(n_basis=10, switching=False))


@pytest.fixture
def moving(library):
    estimator = ir.IntentEstimator(library)
    times_s, human, _ = reach(np.random.default_rng(1), 0.7)
    for stamp_s, values in zip(times_s[:60], human, strict=False):
        estimate = estimator.observe(stamp_s, values)
    yield estimator, estimate
    pyplot.close("all")


def test_an_estimate_is_drawn_as_its_probabilities(moving):
    _, estimate = moving
    axes = estimate.plot()
    assert [bar.get_width() for bar in axes.patches] == estimate.probabilities.tolist()
    assert tuple(label.get_text() for label in axes.get_yticklabels()) == estimate.labels
    assert ir.Estimate.idle(0, ("a", "none")).plot(axes).get_title() == "0.00 s, at rest"


@pytest.mark.parametrize("agent", ["controlled", "observed"])
def test_a_prediction_is_drawn_in_bands_of_two_standard_deviations(moving, library, agent):
    prediction = getattr(moving[0], f"predict_{agent}")()
    (panel,) = prediction.plot().axes
    names = getattr(library, f"{agent}_names")
    assert [text.get_text() for text in panel.get_legend().get_texts()] == list(names)
    trajectory = prediction.trajectory
    for k, (line, band) in enumerate(zip(panel.lines, panel.collections, strict=True)):
        np.testing.assert_array_equal(line.get_ydata(), trajectory.positions[:, k])
        y = band.get_paths()[0].vertices[:, 1]
        highest = (trajectory.positions + 2.0 * trajectory.std)[:, k].max()
        np.testing.assert_allclose(y.max(), highest)


def test_a_library_is_drawn_by_task_agent_and_unit(library):
    figure = library.plot()
    assert [axes.get_title() for axes in figure.axes] == ["far", "near", "", ""]
    assert [one.get_ylabel() for one in figure.axes] == ["observed [m]", "", "controlled [rad]", ""]
    assert figure.axes[0].get_ylim() == figure.axes[1].get_ylim()  # tasks can be compared
    far = figure.axes[0].lines[0].get_ydata()
    assert abs(far[-1] - 0.7) < 0.1
    pyplot.close("all")


def test_dollars_in_names_are_no_mathematics(library):
    """matplotlib refuses such a text once it is drawn."""
    labels, names = ("$^$", "a$}$"), ("$_$", "{$^$}")
    odd = replace(library, labels=labels, observed_names=names)
    estimate = ir.Estimate.idle(0, (*labels, "none"))
    for figure in (odd.plot(), estimate.plot().figure):
        figure.canvas.draw()
    pyplot.close("all")
