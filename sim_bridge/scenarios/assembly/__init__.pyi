# SPDX-License-Identifier: Apache-2.0
from .live import REST_M, in_assistants_place, plan_live
from .session import MARGIN_S, SESSIONS, AssemblySession, of_worker, plan_session
from .styles import ASSISTANT, FASTENING, HAND_OVER, PERSONAL_STD_M, WORKER

__all__ = [
    "ASSISTANT",
    "FASTENING",
    "HAND_OVER",
    "MARGIN_S",
    "PERSONAL_STD_M",
    "REST_M",
    "SESSIONS",
    "WORKER",
    "AssemblySession",
    "in_assistants_place",
    "of_worker",
    "plan_live",
    "plan_session",
]
