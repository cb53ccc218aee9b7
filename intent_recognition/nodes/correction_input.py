# SPDX-License-Identifier: Apache-2.0
"""Whether a person may correct the arm by hand: how its tracking errors are told from pushes."""

from pathlib import Path

import numpy as np
from rclpy.node import Node

from intent_recognition.errors import ArgumentError
from intent_recognition.motion import Correction, DeviationDetector, Spread
from intent_recognition.nodes.activation_parameters import Taught
from intent_recognition.nodes.parameters import declare
from intent_recognition.share import share_path
from intent_recognition.untrusted import load_yaml, read_text

SHIPPED = "config/deviation"


class CorrectionInput:
    """Reads the detector, and knows how the tasks of a library may be corrected.

    Attributes:
        correction: None where the arm does not yield.
    """

    def __init__(self, node: Node) -> None:
        name = declare(node, "correction")["correction"]
        self._detector = load_detector(name) if name else None
        self.correction: Correction | None = None
        self._made_for: Taught | None = None

    def update(self, names: tuple[str, ...], taught: Taught) -> None:
        """Go by these joints and tasks."""
        detector = self._detector
        if detector is None:
            return
        if detector.explained.size != len(names):
            expected = f"errors of {len(names)} joints"
            cure = "Give a file of this arm."
            raise ArgumentError.about("correction", expected, f"{detector.explained.size}", cure)
        if taught is not self._made_for:
            self._made_for = taught
            self.correction = Correction(detector, taught.spreads(Spread.given_person))


def load_detector(name: str) -> DeviationDetector:
    """A detector from a YAML file, or a shipped one by its name."""
    path = Path(name)
    if path.suffix != ".yaml":
        path = share_path(f"{SHIPPED}/{name}.yaml")
    try:
        found = load_yaml(read_text(path))
        coefficients = np.array([found[key] for key in ("constant", "velocity", "acceleration")])
        explained = np.array(found["explained"], dtype=np.float64)
        numbers = [float(found[key]) for key in ("sustained", "false_alarm_rate", "least")]
        fits = explained.ndim == 1 and coefficients.shape == (3, explained.size)
        values = [*coefficients.ravel(), *explained.ravel(), *numbers]
        if not fits or not np.all(np.isfinite(values)) or min(numbers) < 0.0:
            raise ValueError("numbers that do not fit")
    except (OSError, KeyError, TypeError, ValueError) as error:
        expected = (
            "constant, velocity, acceleration, explained, one number a joint each, and sustained,"
            " false_alarm_rate, least"
        )
        raise ArgumentError.about(str(path), expected, error, "Correct the file.") from None
    return DeviationDetector(coefficients.astype(np.float64), explained, *numbers)
