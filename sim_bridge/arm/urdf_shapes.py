# SPDX-License-Identifier: Apache-2.0
"""How the arm looks and what it collides with: primitive shapes in the links' own axes."""

from dataclasses import dataclass
from math import pi

COLOURS: dict[str, tuple[float, float, float, float]] = {
    "lwr_orange": (0.95, 0.38, 0.06, 1.0),
    "lwr_grey": (0.62, 0.64, 0.66, 1.0),
    "lwr_light": (0.80, 0.81, 0.83, 1.0),
    "lwr_dark": (0.16, 0.17, 0.19, 1.0),
}


@dataclass(frozen=True)
class LinkShape:
    """One primitive: `kind` is box, cylinder or sphere, `size` its URDF attributes."""

    kind: str
    size: dict[str, str]
    xyz: tuple[float, float, float]
    rpy: tuple[float, float, float]
    colour_name: str
    collides: bool = True

    @property
    def rgba(self) -> tuple[float, float, float, float]:
        """Colour, each channel in [0, 1]."""
        return COLOURS[self.colour_name]


def cylinder(
    axis: str, start: float, end: float, radius: float, colour: str, *, collides: bool = True
) -> LinkShape:
    """Return a cylinder along the link's y or z axis between two heights [m]."""
    middle = 0.5 * (start + end)
    size = {"radius": f"{radius:g}", "length": f"{abs(end - start):g}"}
    if axis == "z":
        return LinkShape("cylinder", size, (0.0, 0.0, middle), (0.0, 0.0, 0.0), colour, collides)
    turned = (pi / 2.0, 0.0, 0.0)
    return LinkShape("cylinder", size, (0.0, middle, 0.0), turned, colour, collides)


def ball(radius: float, colour: str) -> LinkShape:
    """Return a sphere around the link's origin, radius [m]."""
    return LinkShape("sphere", {"radius": f"{radius:g}"}, (0.0,) * 3, (0.0,) * 3, colour)


def box(
    size_m: tuple[float, float, float], xyz: tuple[float, float, float], colour: str
) -> LinkShape:
    """Return a box that is only drawn, with its edges along the link's axes [m]."""
    size = {"size": " ".join(f"{edge:g}" for edge in size_m)}
    return LinkShape("box", size, xyz, (0.0, 0.0, 0.0), colour, collides=False)


BASE_SHAPES = (
    cylinder("z", 0.0, 0.02, 0.10, "lwr_dark"),
    cylinder("z", 0.02, 0.115, 0.075, "lwr_light"),
)
# A link after a pitch joint (2, 4, 6) starts as the joint's drum across the arm and runs along
# its own +-y; a link before one runs along z and ends short of the next joint's drum.
LINK_SHAPES = (
    (
        cylinder("z", 0.115, 0.125, 0.072, "lwr_grey", collides=False),
        cylinder("z", 0.125, 0.25, 0.068, "lwr_orange"),
    ),
    (
        cylinder("z", -0.085, 0.085, 0.066, "lwr_grey"),
        cylinder("y", 0.0, 0.19, 0.064, "lwr_orange"),
    ),
    (
        cylinder("z", 0.19, 0.20, 0.066, "lwr_grey", collides=False),
        cylinder("z", 0.20, 0.345, 0.064, "lwr_orange"),
    ),
    (
        cylinder("z", -0.082, 0.082, 0.062, "lwr_grey"),
        cylinder("y", -0.19, 0.0, 0.060, "lwr_orange"),
    ),
    (
        cylinder("z", 0.19, 0.20, 0.062, "lwr_grey", collides=False),
        cylinder("z", 0.20, 0.34, 0.058, "lwr_orange"),
    ),
    (ball(0.060, "lwr_orange"), cylinder("z", -0.068, 0.068, 0.045, "lwr_grey")),
    (cylinder("z", 0.052, 0.078, 0.036, "lwr_dark"),),
)
HAND_SHAPES = (
    box((0.09, 0.045, 0.035), (0.0, 0.0, 0.0955), "lwr_dark"),
    box((0.014, 0.022, 0.07), (0.026, 0.0, 0.148), "lwr_grey"),
    box((0.014, 0.022, 0.07), (-0.026, 0.0, 0.148), "lwr_grey"),
)
