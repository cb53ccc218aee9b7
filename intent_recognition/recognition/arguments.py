# SPDX-License-Identifier: Apache-2.0
"""Conversion and checks of the arguments of `IntentEstimator`."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError, DofError, ShapeError, check_type, check_whole
from intent_recognition.promp import TaskLibrary
from intent_recognition.signals import Misfit, Observation, SignalPast, as_numbers, as_stamp_ns

LIBRARY_CURE = "Pass what `learn` returns, or `load_model(path).library`."


def as_observation(
    sizes: Sequence[int],
    stamp_s: float,
    values: ArrayLike,
    signal: int,
    dofs: Sequence[int] | None,
    covariance: ArrayLike | None,
) -> Observation:
    """Observation from the arguments of `IntentEstimator.observe`, whose shapes are checked here.

    Its values may be NaN. `sizes` are the signals' DOFs.
    """
    check_whole("signal", signal, 0, "`observed_groups` lists the signals.", len(sizes) - 1)
    n_dofs = sizes[signal]
    some = None if dofs is None else tuple(np.atleast_1d(dofs).tolist())
    if some is not None and not (
        some and len(set(some)) == len(some) and all(k in range(n_dofs) for k in some)
    ):
        expected = f"different numbers from 0 to {n_dofs - 1}"
        cure = "Leave out the DOFs that were not measured."
        raise ArgumentError.about("dofs", expected, list(some), cure)
    stamp_ns, numbers = as_stamp_ns("stamp_s", stamp_s), as_numbers("values", values)
    matrix = None if covariance is None else as_numbers("covariance", covariance)
    observation = Observation(stamp_ns, signal, numbers, matrix, some)
    m = len(some) if some else n_dofs
    if numbers.shape != (m,):
        raise observation_error("wrong_size", observation, n_dofs)
    if matrix is not None and matrix.shape != (m, m):
        raise observation_error("bad_covariance", observation, n_dofs)
    return observation


def check_observation(observation: Observation) -> str | None:
    """Refuse what is no observation of a DOF, such as arrays; return "zero_stamp" if unstamped."""
    cure = "Pass an array of numbers to `observe`, or to `observe_controlled`."
    check_type("observation", observation, Observation, cure)
    if observation.dofs is not None and not len(observation.dofs):
        cure = "Leave out an observation of nothing."
        raise ArgumentError.about("observation.dofs", "a DOF, or None for all", "none", cure)
    return "zero_stamp" if observation.stamp_ns <= 0 else None


def as_posture(n_controlled: int, stamp_s: float, values: ArrayLike, signal: int) -> Observation:
    """Observation from the arguments of `IntentEstimator.observe_controlled`, in part checked.

    `PostureHistory.take` checks the rest. `n_controlled` is the number of controlled DOFs.
    """
    position = as_numbers("values", values)
    if position.ndim != 1 or len(position) > n_controlled:
        cure = "Pass the positions of one controlled signal."
        expected = f"a vector of at most {n_controlled} numbers"
        raise ShapeError.about("values", expected, position.shape, cure)
    check_whole("signal", signal, 0, "Count the controlled signals from 0.", n_controlled - 1)
    return Observation(as_stamp_ns("stamp_s", stamp_s), signal, position)


def observation_error(
    reason: str, observation: Observation, n_dofs: int, misfit: Misfit | None = None
) -> ArgumentError:
    """Error for a defect (a diagnostics key) of an observation of a signal of `n_dofs`."""
    if reason == "unit" and misfit is not None:
        return ArgumentError(misfit.reason)
    m = n_dofs if observation.dofs is None else len(observation.dofs)
    if reason == "wrong_size":
        cure = "Pass every DOF of the signal, or name those that were measured as `dofs`."
        shape = np.shape(observation.values)
        return ShapeError.about("values", f"shape ({m},)", shape, cure)
    if reason == "not_finite":
        cure = "Set what was not measured to NaN, or leave the sample out."
        return ArgumentError.about("values", "finite numbers or NaN", observation.values, cure)
    if reason == "stamp_not_increasing":
        cure = "Pass measurements in the order of their stamps; `reset` to start anew."
        got = f"{observation.stamp_ns * 1e-9:.9g}"
        return ArgumentError.about("stamp_s", "a stamp later than the last", got, cure)
    cure = "Pass one row and one column per value."
    expected = f"a positive semidefinite matrix of shape ({m}, {m})"
    return ArgumentError.about("covariance", expected, observation.covariance, cure)


def as_times(times_s: ArrayLike) -> Floats:
    """Times as a finite array (T,) [s], also from a single number."""
    times = np.atleast_1d(as_numbers("times_s", times_s))
    if times.ndim != 1:
        raise ShapeError.about("times_s", "shape (T,)", times.shape, "Pass one time each.")
    if not np.all(np.isfinite(times)):
        raise ArgumentError.about("times_s", "finite numbers", times, "Leave the others out.")
    return times


def values_defect(observation: Observation, n_dofs: int) -> str | None:
    """Defect of the values of a signal of `n_dofs`, as a diagnostics key, or None."""
    expected = n_dofs if observation.dofs is None else len(observation.dofs)
    if np.shape(observation.values) != (expected,):
        return "wrong_size"
    # or NaN; larger squares lose all precision
    if not all(-1e12 < value < 1e12 for value in observation.values.tolist()):
        return "not_finite"
    return None


def covariance_defect(observation: Observation, past: SignalPast) -> str | None:
    """Defect of the covariance of valid values, as a diagnostics key, or None."""
    covariance, m = observation.covariance, len(observation.values)
    if covariance is None:
        return "no_covariance" if observation.derivative else None
    fits = np.shape(covariance) == (m, m) and past.is_covariance(covariance)
    if fits and observation.derivative:  # no learned noise is added
        fits = bool(np.linalg.cond(covariance) < 1e12)
    return None if fits else "bad_covariance"


def check_same_dofs(known: TaskLibrary, other: TaskLibrary) -> None:
    """Refuse a library that cannot replace another one: its DOFs or its context differ."""
    check_type("library", other, TaskLibrary, LIBRARY_CURE)
    observed = "observed_names", "observed_units", "observed_groups"
    for name in (*observed, "controlled_names", "controlled_units", "context_names"):
        ours, theirs = getattr(known, name), getattr(other, name)
        if ours != theirs:
            cure = "Train on the same DOFs."
            raise DofError.about(f"library {name}", str(ours), str(theirs), cure)
