# SPDX-License-Identifier: Apache-2.0
"""From a predicted path to commands: retiming, plans, blending, clearance, separation."""

from intent_recognition.motion.bending import Spread
from intent_recognition.motion.blending import decay
from intent_recognition.motion.clearance import Clearance, ClearPath, Obstruction
from intent_recognition.motion.correction import Correction, Via, phase_of, with_via
from intent_recognition.motion.deviation import DeviationDetector, TrackedMotion, calibrate_detector
from intent_recognition.motion.hand_path import hand_targets, is_hand, joints_along
from intent_recognition.motion.path import JointPath, check_range, make_path, way_of
from intent_recognition.motion.plan import (
    BEGINNING,
    JointPlan,
    JointReference,
    PhaseState,
    sample_times,
    scaled_limits,
)
from intent_recognition.motion.planning import brake_along, plan_interaction, stop_plan
from intent_recognition.motion.point_to_point import posture_plan
from intent_recognition.motion.retiming import NominalTiming
from intent_recognition.motion.separation import (
    PredictedPerson,
    Separation,
    SeparationSettings,
    SlowPlaces,
    parse_places,
    phase_times_ns,
)
