# SPDX-License-Identifier: Apache-2.0
"""The node `lwr_sim`: `arm_sim` with the KUKA LWR 4+."""

from functools import partial
from typing import Any

from intent_recognition.nodes.runtime import run
from sim_bridge.arm import find_robot
from sim_bridge.nodes.arm_sim import ArmSim


class LwrSim(ArmSim):
    """The simulated LWR; topics, services and parameters are those of `ArmSim`."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("lwr_sim", find_robot("lwr"), **kwargs)


main = partial(run, LwrSim)
