# SPDX-License-Identifier: Apache-2.0
"""The interaction primitive: basis functions, weights, their prior, and prediction."""

from intent_recognition.promp.basis import NormalizedRBFBasis
from intent_recognition.promp.combining import (
    Blend,
    blend,
    co_activate,
    minimum_jerk,
    smooth_switch,
    via_point,
)
from intent_recognition.promp.context import CONTEXT_STRENGTH, ContextModel, as_context
from intent_recognition.promp.control_points import (
    ControlPoint,
    controlled_at,
    distance_to,
    through,
)
from intent_recognition.promp.coupling import ResidualCoupling, residual_weights
from intent_recognition.promp.interaction import InteractionProMP
from intent_recognition.promp.library import TaskLibrary
from intent_recognition.promp.phase_deviation import (
    STEADY,
    STUDENT_FREEDOM,
    PhaseDeviation,
    deviation_prior,
    deviation_transition,
    reference_phase,
    steady_phase,
    steady_rate,
)
from intent_recognition.promp.pose_regression import (
    LEADS,
    STEP,
    PoseRegression,
    pose_kernel,
    stack_tasks,
)
from intent_recognition.promp.prediction import (
    USUAL_END_STD,
    StartPosture,
    angle_starts,
    controlled_spread,
    controlled_weights,
    end_std_limits,
    largest_by_unit,
    least_end_std,
)
from intent_recognition.promp.prior import (
    LAGS,
    OTHERS_SAMPLE_SIZE,
    USUAL,
    Scatter,
    TargetSettings,
    explained_by_lag,
    observed_block,
    predictive_covariance,
    shared_covariance,
    structured_target,
    weight_floor,
    without_demonstration,
)
from intent_recognition.promp.risk import (
    LEAST_SHARE,
    MAX_NONE,
    NO_ODDS,
    UNNAMED,
    LeftOutOdds,
    Risk,
    conformal_bound,
    risk_of,
)
from intent_recognition.promp.trajectory import Trajectory, check_points, dof_variance, rollout
from intent_recognition.promp.weights import fit_weights
from intent_recognition.signals import NONE
