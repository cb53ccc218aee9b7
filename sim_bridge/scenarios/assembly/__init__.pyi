# SPDX-License-Identifier: Apache-2.0
from .session import MARGIN_S as MARGIN_S
from .session import REST_M as REST_M
from .session import SESSIONS as SESSIONS
from .session import in_assistants_place as in_assistants_place
from .session import of_worker as of_worker
from .session import plan_live as plan_live
from .session import plan_session as plan_session
from .styles import ASSISTANT as ASSISTANT
from .styles import FASTENING as FASTENING
from .styles import HAND_OVER as HAND_OVER
from .styles import PERSONAL_STD_M as PERSONAL_STD_M
from .styles import WORKER as WORKER
