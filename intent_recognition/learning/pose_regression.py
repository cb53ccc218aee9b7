# SPDX-License-Identifier: Apache-2.0
"""Learn how the controlled agent follows the present state, from left-out demonstrations.

The length scale and noise of each task's regression (`promp.pose_regression`) and its share in the
prediction are those which, with the primitive, predict other demonstrations of the task best. The
primitive's predicted position is no part of the state: it is learned without the very movement that
is to be predicted, and would give away what that movement is not.
"""

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats, Integers
from intent_recognition.learning.evidence_exponents import (
    N_DURATIONS,
    duration_weights,
    follow_durations,
)
from intent_recognition.learning.examples import interpolated, pose_phases, sample_phases
from intent_recognition.learning.held_out import batches_of, expected_rows, predict_agents
from intent_recognition.learning.held_out_examples import LeftOutExample, evenly
from intent_recognition.promp import (
    LEADS,
    PoseRegression,
    ResidualCoupling,
    TaskLibrary,
    pose_kernel,
    stack_tasks,
)

EVERY = 3
"""Samples from one that is judged to the next; a displacement in the state spans two."""
LENGTHS, NOISES = (0.5, 1.0, 2.5), (0.06, 0.6)
"""Length scales, in standard deviations, and variances of the noise beside a kernel of one."""
LEAST, DENSE, MOST = 4, 10, 20
"""Fewest people (or demonstrations by unknown ones) of a task with a regression, as the variance of
Student's t demands; most demonstrations of which all samples, and most of which the judged ones are
in it. The last two bound computing time."""


class _Moments(NamedTuple):
    """States (n, m, F) of n demonstrations at m moments, and controlled poses ahead of them.

    The poses and those that the primitive predicts are (n, L, m, Q). After the end, poses are the
    last one, and predictions NaN; so are those of samples that are not judged.
    """

    state: Floats
    pose: Floats
    predicted: Floats


class _Fit(NamedTuple):
    """Coefficients (n m, L, Q), shares (L,) and mean squared errors of n demonstrations, (n, L)."""

    coefficients: Floats
    share: Floats
    errors: Floats


def learn_pose_regression(
    library: TaskLibrary,
    left_out: Sequence[LeftOutExample],
    exponent: float,
    coupling: ResidualCoupling,
    variance: Floats,
) -> PoseRegression | None:
    """Learn the regression of each task on the present state; None if no task gains by one.

    Args:
        library: provides basis, noise and timing.
        left_out: the demonstrations.
        exponent: exponent of the evidence on the duration.
        coupling: coupling of the residuals, which the primitive's prediction includes.
        variance: divides the squared errors of the controlled DOFs, (Q,).
    """
    noise = library.noise_variance[np.r_[: library.n_observed, : len(library.noise_variance)]]
    found = {}
    for task in range(library.n_tasks):
        own = evenly([one for one in left_out if one.task == task], MOST)
        people = _people(own)
        if len(set(people)) < LEAST:
            continue
        parts = [
            _moments(library, some, exponent, coupling, dense=len(own) <= DENSE)
            for some in batches_of(library, own, N_DURATIONS)
        ]
        moments = _Moments(*(np.concatenate(part) for part in zip(*parts, strict=True)))
        regression = _best(moments, people, noise, variance)
        if regression.share.any():
            found[task] = regression
    if not found:
        return None
    return PoseRegression(*stack_tasks(PoseRegression._fields, found, library.n_tasks))


def _people(left_out: Sequence[LeftOutExample]) -> Integers:
    """Numbers of those who showed the demonstrations, (n,); one each if they are not known."""
    groups = [one.group for one in left_out]
    if all(groups) and len(set(groups)) > 1:
        return np.unique(groups, return_inverse=True)[1]
    return np.arange(len(groups))


def _best(moments: _Moments, people: Integers, noise: Floats, variance: Floats) -> PoseRegression:
    """The regression of one task that predicts left-out people best; its fields lack the axis K.

    `noise` is the variance with which the state is known, (F,).
    """
    centre = moments.state.mean(axis=(0, 1))
    scale = np.sqrt(moments.state.var(axis=(0, 1)) + noise)
    standardised = moments._replace(state=(moments.state - centre) / scale)
    fits = {
        (length, of_pose): _fit(standardised, people, length, of_pose, variance)
        for length, of_pose in product(LENGTHS, NOISES)
    }
    best = min(fits, key=lambda one: float(fits[one].errors.sum()))
    states = standardised.state.reshape(-1, len(centre))
    coefficients, share, _ = fits[best]
    return PoseRegression(centre, scale, states, np.array(best[0]), coefficients, share)


def _fit(
    moments: _Moments,
    people: Integers,
    length: float,
    noise: float,
    variance: Floats,
) -> _Fit:
    """Fit the regression to standardised states, and judge it by left-out people (n,)."""
    n, m, size = moments.state.shape
    flat, person = moments.state.reshape(n * m, size), np.repeat(people, m)
    poses = np.moveaxis(moments.pose, 1, 2).reshape(n * m, -1)
    inverse = np.linalg.inv(pose_kernel(flat, flat, length) + noise * np.eye(n * m))
    coefficients, alone = inverse @ poses, np.empty_like(poses)
    for one in np.unique(people):
        rows = np.flatnonzero(person == one)
        left = np.linalg.solve(inverse[np.ix_(rows, rows)], coefficients[rows])
        alone[rows] = poses[rows] - left
    by_lead = np.moveaxis(alone.reshape(n, m, len(LEADS), -1), 2, 1)
    towards, error = by_lead - moments.predicted, moments.pose - moments.predicted
    share = _share(towards / np.sqrt(variance), error / np.sqrt(variance), people)
    squared = (error - share[:, None, None] * towards) ** 2 / variance
    errors = np.nanmean(squared, axis=2).sum(axis=-1)
    return _Fit(coefficients.reshape(n * m, len(LEADS), -1), share, errors)


def _share(towards: Floats, error: Floats, people: Integers) -> Floats:
    """Share of the way towards the regression that leaves the least error of left-out people, (L,).

    As it is known from n people only, it is shrunk by its variance, that of Student's t of n - 1
    degrees of freedom (a positive-part estimator; Efron and Morris 1973, JASA 68).
    """
    of_person = people[:, None] == np.unique(people)
    moved, whole = (
        of_person.T @ np.nansum(towards * other, axis=(2, 3)) for other in (error, towards)
    )  # (n, L) each
    total, n = whole.sum(axis=0) + 1e-300, len(whole)
    share = moved.sum(axis=0) / total
    variance = n / (n - 3) * np.sum(((moved - share * whole) / total) ** 2, axis=0)
    return np.clip(share - variance / np.maximum(share, 1e-300), 0.0, 1.0)


def _moments(
    library: TaskLibrary,
    left_out: Sequence[LeftOutExample],
    exponent: float,
    coupling: ResidualCoupling,
    *,
    dense: bool,
) -> _Moments:
    """States and poses of demonstrations under their own tasks, at all or at the judged samples."""
    values, task = np.array([one.observed for one in left_out]), [one.task for one in left_out]
    decay = coupling.decay_s[task] / library.durations_s[task]
    usual = library.weight_mean[task, library.n_observed_weights :]
    usual = usual.reshape(len(task), library.n_controlled, -1)
    lasting = np.exp(-LEADS / decay[:, None])[..., None]
    states, poses, predicted = [], [], []
    for k, followed in enumerate(follow_durations(library, left_out)):
        judged = k % EVERY == EVERY - 1
        if not (judged or dense):
            continue
        ahead, at = sample_phases()[k] + LEADS, values[:, k]
        weight = duration_weights(followed.progress.log_evidence[followed.own], exponent)
        _, rows = expected_rows(library, left_out, followed, ahead[:1])
        row = np.einsum("nh,nhk->nk", weight, rows.reshape(*weight.shape, -1))
        path = np.einsum("nqk,nk->nq", usual, row)
        states.append(np.hstack([at, at - values[:, max(k - 2, 0)], path]))
        poses.append(np.array([interpolated(ahead, pose_phases(), one.poses) for one in left_out]))
        predicted.append(np.full_like(poses[-1], np.nan))
        if judged:
            both = predict_agents(library, left_out, followed, ahead, start_known=True)
            human, robot = (np.einsum("nh,nhsd->nsd", weight, path) for path in both)
            local = np.einsum("nqp,np->nq", coupling.gain[task], at - human[:, 0])
            predicted[-1][:, ahead <= 1.0] = (robot + lasting * local[:, None])[:, ahead <= 1.0]
    parts = np.stack(poses, axis=2), np.stack(predicted, axis=2)
    return _Moments(np.stack(states, axis=1), *parts)
