# SPDX-License-Identifier: Apache-2.0
"""Slows simulated time down when the machine cannot keep up, and speeds it up again."""

from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.node import Node

LAG_HIGH_S = 0.12
"""Simulated lag of the newest estimate above which time slows down [s]."""
LAG_LOW_S = 0.06
"""Lag below which time speeds up again [s]."""
SLOWEST = 0.1
"""Simulated seconds per real second that are kept however large the lag."""
PACE_PERIOD_S = 0.2
"""Time between two looks at the lag [s]."""
SLOWER, FASTER = 0.6, 1.15
"""Factors on the pace at each look; slowing down is quicker than speeding up."""


def next_factor(factor: float, asked: float, lag_s: float) -> float:
    """Next pace: slower when the nodes lag, else back toward the one asked for [simulated s/s]."""
    if lag_s > LAG_HIGH_S:
        return max(factor * SLOWER, min(SLOWEST, asked))
    if lag_s < LAG_LOW_S:
        return min(factor * FASTER, asked)
    return factor


class PaceKeeper:
    """Sets `real_time_factor` of the arm's physics so that the other nodes keep up.

    On a busy machine a human movement would otherwise be over before the slowest node had
    processed its beginning.

    Args:
        node: whose executor spins.
        asked: simulated seconds per real second when nothing lags.
    """

    def __init__(self, node: Node, asked: float):
        self._client = node.create_client(SetParameters, "lwr_sim/set_parameters")
        self._asked = self.factor = asked
        self.slowest = asked

    def update(self, lag_s: float) -> None:
        """Take the lag measured now into account."""
        factor = next_factor(self.factor, self._asked, lag_s)
        if factor == self.factor or not self._client.service_is_ready():
            return
        self.factor = factor
        self.slowest = min(self.slowest, factor)
        value = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=float(factor))
        change = Parameter(name="real_time_factor", value=value)
        request = SetParameters.Request(parameters=[change])
        self._client.call_async(request)
