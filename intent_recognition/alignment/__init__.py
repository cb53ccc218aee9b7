# SPDX-License-Identifier: Apache-2.0
"""Time alignment: smooth warps that bring demonstrations onto a reference."""

from intent_recognition.alignment.reference import Template, even_trajectory, medoid
from intent_recognition.alignment.time_alignment import (
    Alignment,
    AlignmentSettings,
    align,
    align_to,
)
from intent_recognition.alignment.warp import Warp
