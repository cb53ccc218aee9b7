# SPDX-License-Identifier: Apache-2.0
"""The interaction primitive: basis functions, weights, their prior, and prediction."""

from intent_recognition.promp.aligned import AlignedPrimitives
from intent_recognition.promp.basis import NormalizedRBFBasis
from intent_recognition.promp.control_grid import ControlGrid
from intent_recognition.promp.interaction import InteractionProMP
from intent_recognition.promp.library import IDENTITY_CALIBRATION, NONE, TaskLibrary
from intent_recognition.promp.phase_deviation import (
    PhaseDeviation,
    deviation_grid,
    deviation_prior,
    deviation_transition,
    reference_phase,
)
from intent_recognition.promp.prediction import (
    StartPosture,
    Trajectory,
    controlled_weights,
    dof_variance,
    largest_by_unit,
    least_end_std,
    rollout,
)
from intent_recognition.promp.prior import (
    OWN_COVARIANCE_SHARE,
    Scatter,
    leave_one_out_scatter,
    leave_one_out_targets,
    observed_block,
    recognition_covariances,
    shrunk_covariance,
    structured_target,
    weight_floor,
)
from intent_recognition.promp.weights import (
    WeightFit,
    fit_weights,
    fit_weights_together,
)

__all__ = [
    "IDENTITY_CALIBRATION",
    "NONE",
    "OWN_COVARIANCE_SHARE",
    "AlignedPrimitives",
    "ControlGrid",
    "InteractionProMP",
    "NormalizedRBFBasis",
    "PhaseDeviation",
    "Scatter",
    "StartPosture",
    "TaskLibrary",
    "Trajectory",
    "WeightFit",
    "controlled_weights",
    "deviation_grid",
    "deviation_prior",
    "deviation_transition",
    "dof_variance",
    "fit_weights",
    "fit_weights_together",
    "largest_by_unit",
    "least_end_std",
    "leave_one_out_scatter",
    "leave_one_out_targets",
    "observed_block",
    "recognition_covariances",
    "reference_phase",
    "rollout",
    "shrunk_covariance",
    "structured_target",
    "weight_floor",
]
