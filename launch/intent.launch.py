# SPDX-License-Identifier: Apache-2.0
"""The recognition side: mocap_ingest, intent_estimator and primitive_activation.

ros2 launch intent_recognition intent.launch.py model:=toolbox.npz
Start `sim.launch.py` or the rest of the cell beside it; for a real arm see `real.launch.py`.
"""

from launch import LaunchDescription

from intent_recognition.nodes.launching import describe_graph


def generate_launch_description() -> LaunchDescription:
    return describe_graph("intent")
