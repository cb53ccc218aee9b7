# SPDX-License-Identifier: Apache-2.0
from .activation import Activation, ActivationSettings
from .alignment import Alignment, AlignmentSettings, Warp, align, align_to
from .bags import BagReader, BagWriter, recover
from .demonstrations import DofEntry, DofSpec, load_dofs, read_demonstrations
from .errors import (
    ArgumentError,
    BagError,
    DofError,
    IntentError,
    ModelError,
    ShapeError,
    TrainingError,
)
from .evaluation import evaluate, make_folds, reliability_bins
from .gaussian import Gaussian, GaussianMixture, condition, fit_gaussian_mixture, marginal
from .learning import (
    TrainingSettings,
    cut_to_movement,
    fit_interaction_promp,
    learn,
    learn_mixture,
    learn_with_report,
)
from .model import Model, load_model, save_model
from .objects import find_object, load_object
from .promp import InteractionProMP, NormalizedRBFBasis, TaskLibrary, Trajectory
from .recognition import (
    DecisionSettings,
    DecisionState,
    Estimate,
    IntentEstimator,
    TaskPosterior,
    decide,
    decision_settings,
    predict_controlled,
    recognize_task,
)
from .signals import Demonstration, Observation, Signal
from .warping import (
    AnnotatedObject,
    ObjectCloud,
    ObjectModel,
    Part,
    PouringParameters,
    WarpedObject,
    WarpedPrimitive,
    pouring_parameters,
    warp_object,
)

__version__: str

__all__ = [
    "Activation",
    "ActivationSettings",
    "Alignment",
    "AlignmentSettings",
    "AnnotatedObject",
    "ArgumentError",
    "BagError",
    "BagReader",
    "BagWriter",
    "DecisionSettings",
    "DecisionState",
    "Demonstration",
    "DofEntry",
    "DofError",
    "DofSpec",
    "Estimate",
    "Gaussian",
    "GaussianMixture",
    "IntentError",
    "IntentEstimator",
    "InteractionProMP",
    "Model",
    "ModelError",
    "NormalizedRBFBasis",
    "ObjectCloud",
    "ObjectModel",
    "Observation",
    "Part",
    "PouringParameters",
    "ShapeError",
    "Signal",
    "TaskLibrary",
    "TaskPosterior",
    "TrainingError",
    "TrainingSettings",
    "Trajectory",
    "Warp",
    "WarpedObject",
    "WarpedPrimitive",
    "align",
    "align_to",
    "condition",
    "cut_to_movement",
    "decide",
    "decision_settings",
    "evaluate",
    "find_object",
    "fit_gaussian_mixture",
    "fit_interaction_promp",
    "learn",
    "learn_mixture",
    "learn_with_report",
    "load_dofs",
    "load_model",
    "load_object",
    "make_folds",
    "marginal",
    "pouring_parameters",
    "predict_controlled",
    "read_demonstrations",
    "recognize_task",
    "recover",
    "reliability_bins",
    "save_model",
    "warp_object",
]
