# SPDX-License-Identifier: Apache-2.0
"""The physical side: PyBullet LWR arm, simulated coworker, demonstrations."""
