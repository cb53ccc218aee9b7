# SPDX-License-Identifier: Apache-2.0
"""The aligned primitives inside a model file, where predictions come from them."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intent_recognition.errors import ArgumentError, ModelError, describe
from intent_recognition.model.arrays import RETRAIN, check_arrays, check_positive, from_upper, upper
from intent_recognition.promp import AlignedPrimitives, NormalizedRBFBasis, PhaseDeviation

ALIGNED = tuple(
    f"aligned_{name}"
    for name in (
        "weight_mean",
        "weight_covariance",
        "noise_variance",
        "noise_scale",
        "deviation_std",
    )
)
"""Names of the arrays in the file."""


def pack_aligned(
    primitives: AlignedPrimitives,
) -> tuple[dict[str, object], dict[str, NDArray[Any]]]:
    """An entry of the JSON header, and arrays by name; of each covariance the upper triangle."""
    phase_deviation = primitives.phase_deviation
    header = {
        "basis": asdict(primitives.basis),
        "correlation": phase_deviation.correlation,
        "evidence": phase_deviation.evidence,
    }
    values = (
        primitives.weight_mean,
        upper(primitives.weight_covariance),
        primitives.noise_variance,
        np.asarray(primitives.noise_scale),
        phase_deviation.deviation_std,
    )
    return header, dict(zip(ALIGNED, values, strict=True))


def unpack_aligned(
    path: str,
    header: Mapping,
    arrays: Mapping[str, NDArray[Any]],
    n_tasks: int,
    n_observed: int,
    n_dofs: int,
) -> AlignedPrimitives:
    """The aligned primitives of a model file, checked.

    Args:
        path: of the file, for messages.
        header: its entry `aligned`.
        arrays: those of `ALIGNED` that the file holds.
        n_tasks: K of the library it belongs to.
        n_observed: its P.
        n_dofs: its D.

    Raises:
        ModelError: something is missing, of another shape, not finite or not positive.
    """
    try:
        basis = NormalizedRBFBasis(**header["basis"])
        correlation, evidence = float(header["correlation"]), float(header["evidence"])
    except (KeyError, TypeError, ValueError, ArgumentError) as error:
        raise ModelError(
            describe(f"{path}: aligned", "a complete header", error, RETRAIN)
        ) from error
    if not (0.0 < correlation < np.inf and 0.0 < evidence <= 1.0):
        raise ModelError(
            describe(
                f"{path}: aligned",
                "a correlation above 0 and an evidence in (0, 1]",
                f"{correlation} and {evidence}",
                RETRAIN,
            )
        )
    size = n_dofs * basis.n_basis
    n_phases = max(np.size(arrays.get("aligned_deviation_std", ())), 2)
    shapes = (
        (n_tasks, size),
        (n_tasks, size * (size + 1) // 2),
        (n_dofs,),
        (),
        (n_phases,),
    )
    check_arrays(path, arrays, dict(zip(ALIGNED, shapes, strict=True)))
    mean, covariance, noise_variance, noise_scale, deviation_std = (
        arrays[name] for name in ALIGNED
    )
    check_positive(path, arrays, "aligned_noise_variance", "aligned_noise_scale")
    if np.any(deviation_std < 0.0):
        raise ModelError(
            describe(
                f"{path}: aligned_deviation_std", "zero or above", deviation_std.min(), RETRAIN
            )
        )
    return AlignedPrimitives(
        basis=basis,
        n_observed=n_observed,
        weight_mean=mean,
        weight_covariance=from_upper(covariance, size),
        noise_variance=noise_variance,
        noise_scale=float(noise_scale),
        phase_deviation=PhaseDeviation(deviation_std, correlation, evidence),
    )
