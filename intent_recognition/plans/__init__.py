# SPDX-License-Identifier: Apache-2.0
"""Plans of assemblies: their steps and order, learned, written and followed online."""

from intent_recognition.plans.file import (
    Assembly,
    DoneTask,
    begun_with,
    read_assemblies,
    read_plan,
    write_plan,
)
from intent_recognition.plans.learning import learn_plan
from intent_recognition.plans.progress import WorkProgress
from intent_recognition.plans.work_plan import (
    LIKELY_BEFORE,
    WorkPlan,
    moved,
    ordered,
    required,
    without,
)
