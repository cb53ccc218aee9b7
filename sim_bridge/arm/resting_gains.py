# SPDX-License-Identifier: Apache-2.0
"""What the stochastic feedback controller of a ProMP (Paraschos et al. 2013) comes to at rest."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from intent_recognition.errors import ArgumentError


@dataclass(frozen=True)
class FeedbackSettings:
    """What the controller is designed against.

    Attributes:
        disturbance: spectral density S of the disturbing accelerations per joint [rad^2/s^3], one
            for all joints or (Q,); after t seconds a free joint's velocity has variance S t.
        bandwidth_rad_s: largest natural frequency w of the closed loop.
        n_times: gains are computed at so many evenly spaced times.

    Raises:
        ArgumentError: a number is not positive, or too few times.
    """

    disturbance: float | tuple[float, ...] = 0.3
    bandwidth_rad_s: float = 20.0
    n_times: int = 401

    def __post_init__(self) -> None:
        """Check the numbers."""
        for name, fine, expected in (
            ("disturbance", np.all(np.array(self.disturbance) > 0), "above 0"),
            ("bandwidth_rad_s", self.bandwidth_rad_s > 0, "above 0"),
            ("n_times", self.n_times >= 3, "at least 3"),
        ):
            if not fine:
                got, cure = getattr(self, name), "See FeedbackSettings for defaults."
                raise ArgumentError.about(name, expected, got, cure)

    def density(self, n_joints: int) -> NDArray[np.float64]:
        """S per joint, (Q,)."""
        return np.broadcast_to(np.array(self.disturbance, dtype=np.float64), (n_joints,))


def resting_gains(
    std: NDArray[np.float64], settings: FeedbackSettings
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Stiffness [1/s^2] and damping [1/s] of joints that are to stay within a spread, each alone.

    What the controller comes to where a distribution changes slowly and correlations of the joints
    are unknown: a critically damped oscillator of frequency (S / (4 std^2))^(1/3), at most the
    largest bandwidth. Positive for any spread, so stable for any reference.

    Args:
        std: standard deviations of the joints' positions (Q,) [rad], not negative.
        settings: what it is designed against.
    """
    std = np.asarray(std, dtype=np.float64)
    density = settings.density(std.shape[-1])
    variance = np.maximum(std**2, density / (4.0 * settings.bandwidth_rad_s**3))
    frequency = np.cbrt(density / (4.0 * variance))
    return frequency**2, 2.0 * frequency
