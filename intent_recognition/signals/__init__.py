# SPDX-License-Identifier: Apache-2.0
"""Measured signals, observations and demonstrations, and the start and end of movements."""

from intent_recognition.signals.arrays import FIRST_CLOCK_S, as_numbers, as_stamp_ns, check_times
from intent_recognition.signals.demonstration import Demonstration, Rejection, numbered
from intent_recognition.signals.doubts import (
    RecordingSummary,
    StreamFinding,
    label_doubts,
    stream_doubts,
    summarise,
)
from intent_recognition.signals.observation import Observation, every_second, merge, observations_of
from intent_recognition.signals.onset import (
    OnsetSettings,
    at_rest,
    detect_onset,
    end_velocity,
    is_slow,
)
from intent_recognition.signals.orientation import (
    LARGEST_ANGLE_RAD,
    LEAST_QUATERNION,
    from_tangent,
    homogeneous,
    mean_orientation,
    quaternion_rates,
    right_jacobian,
    rotation_matrix,
    to_tangent,
    to_tangent_covariance,
)
from intent_recognition.signals.past import (
    CLOCK_RESET_AFTER,
    NEVER_NS,
    LateSamples,
    Samples,
    SignalPast,
)
from intent_recognition.signals.proposals import Span, propose_spans
from intent_recognition.signals.segmentation import LEAST_RATE_HZ, movement_span, onset_settings
from intent_recognition.signals.signal import (
    GROUP,
    LABEL,
    LONGEST_LABEL,
    MIN_SAMPLES,
    NONE,
    ORIENTATION_FIELDS,
    POSE_FIELDS,
    POSITION_FIELDS,
    Signal,
    can_name_task,
)
from intent_recognition.signals.slips import likely_slips, place_of
from intent_recognition.signals.streams import (
    common_span,
    hidden_rows,
    recording_doubts,
    sparse,
    stream_defect,
    zeros,
)
from intent_recognition.signals.turns import (
    TURNS,
    begin_near,
    first_values,
    jumps,
    turn_reference,
    turns_of,
    whole_turns,
)
from intent_recognition.signals.units import (
    LONGEST_PERIOD_S,
    OFTEN_TAKEN,
    SHORTEST_PERIOD_S,
    SPATIAL_UNITS,
    UNITS,
    USUAL_PERIODS_S,
    Known,
    Misfit,
    Size,
    as_quotient,
    commensurate,
    differing_unit,
    is_spatial,
    learned_misfit,
    length_misfit,
    median_size,
    misfit,
    other_units,
    place_misfit,
    scene_misfit,
    size_of,
    spelled,
    taken_for,
    time_misfit,
)
