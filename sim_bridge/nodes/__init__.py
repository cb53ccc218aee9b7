# SPDX-License-Identifier: Apache-2.0
"""The nodes of the simulation: arm and coworker."""

import intent_recognition.nodes
