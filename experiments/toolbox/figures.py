# SPDX-License-Identifier: Apache-2.0
"""Figures of the mixture of the toolbox: its components, and one of them conditioned."""

from collections.abc import Mapping, Sequence

import numpy as np

from intent_recognition.array_types import Floats, Integers
from intent_recognition.report import (
    DASHED,
    INK,
    PALETTE,
    SOFT,
    Drawing,
    fill_two_sigma,
    new_figure,
    readable,
    shared_legend,
    styled,
    task_colours,
)

PRIOR_COLOUR = "#9aa5b1"
POSTERIOR_COLOUR = "#c2185b"


@styled
def components_found_figure(
    phase: Floats,
    observed: Floats,
    controlled: Floats,
    labels: Integers,
    names: Sequence[str],
    tasks: Mapping[int, str],
) -> Drawing:
    """Mean and +-2 sigma of the members of each component, one panel per DOF.

    Args:
        phase: (S,).
        observed: of all demonstrations (n, S, P).
        controlled: likewise (n, S, Q).
        labels: component of each (n,).
        names: of the P + Q DOFs, with units.
        tasks: what most members of each component are, for colour and legend.
    """
    colours = task_colours(tasks.values())
    values = np.concatenate([observed, controlled], axis=2)
    n_rows, n_columns = (2, (len(names) + 1) // 2) if len(names) > 4 else (1, len(names))
    figure = new_figure(2.75 * n_columns, 2.5 * n_rows + 0.4)
    grid = figure.subplots(n_rows, n_columns, sharex=True, squeeze=False)
    flat = _panels(grid, observed.shape[2], controlled.shape[2])
    for dof, (axes, name) in enumerate(zip(flat, names, strict=True)):
        for label in np.unique(labels):
            members = values[labels == label, :, dof]
            mean = members.mean(axis=0)
            std = members.std(axis=0, ddof=1) if len(members) > 1 else np.zeros_like(mean)
            colour = colours[tasks[int(label)]]
            fill_two_sigma(axes, phase, mean, std, colour)
            text = f"component {label + 1}, {len(members)}: {readable(tasks[int(label)])}"
            axes.plot(phase, mean, color=colour, label=text)
        axes.set(ylabel=name, xlim=(0.0, 1.0), xlabel="phase")
    shared_legend(figure, flat[:1], 4)
    return figure


@styled
def conditioned_figure(
    phase: Floats,
    prior_observed: Floats,
    prior_controlled: Floats,
    observed: Floats,
    controlled: Floats,
    mean: Floats,
    std: Floats,
    names: Sequence[str],
) -> Drawing:
    """One test: the component, the observation, the predicted robot and the truth.

    Args:
        phase: (S,).
        prior_observed: members of the component (m, S, P).
        prior_controlled: likewise (m, S, Q).
        observed: the test's human (S, P); its end is the observation.
        controlled: the test's robot (S, Q).
        mean: predicted robot (S, Q).
        std: standard deviation of that (S, Q).
        names: of the P + Q DOFs, with units.
    """
    n_observed, n_controlled = observed.shape[1], controlled.shape[1]
    figure = new_figure(2.75 * max(n_observed, n_controlled), 5.4)
    grid = figure.subplots(2, max(n_observed, n_controlled), sharex=True, squeeze=False)
    flat = _panels(grid, n_observed, n_controlled)
    prior = np.concatenate([prior_observed, prior_controlled], axis=2)
    truth = np.concatenate([observed, controlled], axis=1)
    for dof, (axes, name) in enumerate(zip(flat, names, strict=True)):
        middle, spread = prior[..., dof].mean(axis=0), prior[..., dof].std(axis=0, ddof=1)
        fill_two_sigma(
            axes, phase, middle, spread, PRIOR_COLOUR, alpha=0.35, label="component ± 2 sigma"
        )
        if dof < n_observed:
            axes.plot(
                1.0, observed[-1, dof], "*", color=PALETTE[0], markersize=12, clip_on=False,
                label="observed", zorder=5,
            )  # fmt: skip
        else:
            q = dof - n_observed
            fill_two_sigma(
                axes, phase, mean[:, q], std[:, q], POSTERIOR_COLOUR,
                alpha=0.3, label="predicted ± 2 sigma",
            )  # fmt: skip
            axes.plot(phase, mean[:, q], color=POSTERIOR_COLOUR, label="predicted")
        axes.plot(
            phase, truth[:, dof], color=INK if dof >= n_observed else SOFT, linewidth=1.2,
            linestyle=DASHED, label="truth" if dof >= n_observed else "not conditioned on",
        )  # fmt: skip
        axes.set(ylabel=name, xlim=(0.0, 1.0), xlabel="phase")
    shared_legend(figure, (flat[0], flat[-1]), 6)
    return figure


def _panels(grid: Floats, n_observed: int, n_controlled: int) -> list:
    """Panels of the human in the upper row, of the robot in the lower; the rest is taken away."""
    if len(grid) == 1:
        return list(grid[0])
    for axes in (*grid[0][n_observed:], *grid[1][n_controlled:]):
        axes.remove()
    return [*grid[0][:n_observed], *grid[1][:n_controlled]]
