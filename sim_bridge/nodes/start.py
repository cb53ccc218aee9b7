# SPDX-License-Identifier: Apache-2.0
"""The executables of the simulation's nodes; see `intent_recognition.nodes.start`."""

from functools import partial

from intent_recognition.nodes.start import start

arm_sim = partial(start, "sim_bridge.nodes.arm_sim")
lwr_sim = partial(start, "sim_bridge.nodes.lwr_sim")
coworker_sim = partial(start, "sim_bridge.nodes.coworker_sim")
