# SPDX-License-Identifier: Apache-2.0
"""Transfer grasps and pours from an annotated object to others by warping (Brandl et al. 2014)."""

from intent_recognition.warping.clipping import closed_tube_faces, half_volume_angle, surface_volume
from intent_recognition.warping.grasp_warp import warp_grasp
from intent_recognition.warping.object_model import (
    AnnotatedObject,
    Grasp,
    ObjectCloud,
    Part,
    with_estimated_normals,
)
from intent_recognition.warping.object_warp import (
    LEAST_M,
    Mapping,
    ObjectModel,
    WarpedObject,
    warp_object,
)
from intent_recognition.warping.parameters import (
    PouringParameters,
    References,
    nearest_on_loop,
    pouring_parameters,
)
from intent_recognition.warping.part_labels import LogisticModel, fit_logistic
from intent_recognition.warping.pour_level import (
    EMPTY,
    FULL_SHARE,
    Emptying,
    Reached,
    amount_to_leave,
    emptying,
    reached,
    tilts_to_level,
)
from intent_recognition.warping.pour_plan import PouringSkill, PourPlan, SeenContainer, plan_pour
from intent_recognition.warping.primitives import (
    N_WARPED,
    WarpedPrimitive,
    from_warped,
    to_warped,
    warped_scale,
)
from intent_recognition.warping.wall_checks import check_wall
