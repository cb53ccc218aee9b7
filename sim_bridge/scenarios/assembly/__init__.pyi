# SPDX-License-Identifier: Apache-2.0
from .live import REST_M, in_assistants_place, plan_live
from .session import of_worker
from .styles import FASTENING, HAND_OVER, PERSONAL_STD_M

__all__ = [
    "FASTENING",
    "HAND_OVER",
    "PERSONAL_STD_M",
    "REST_M",
    "in_assistants_place",
    "of_worker",
    "plan_live",
]
