# SPDX-License-Identifier: Apache-2.0
"""Our arm's description, for tests that need no PyBullet."""

from intent_recognition.share import share_path


def lwr_urdf():
    return share_path("config/robots/lwr.urdf").read_text()
