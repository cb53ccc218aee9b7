# SPDX-License-Identifier: Apache-2.0
"""Which containers are poured with, and how many balls are in them."""

from dataclasses import replace

from sim_bridge.balls import ball_radius_m
from sim_bridge.containers import CONTAINER_SEED, SHAPES, Container, build_container, make_container

TASK = "pouring"
N_BALLS = 40
"""Balls that fill half of a cup. Convention."""
BIG_BOWL, BIG_BOWL_SCALE = "big_bowl", 1.5
PAIRS = (
    ("espresso_cup", BIG_BOWL),
    ("mug", "tumbler"),
    ("tumbler", "square_bowl"),
    ("tall_glass", "round_bowl"),
    ("paper_cup", "mug"),
    ("espresso_cup", "tea_cup"),
    ("tea_cup", "paper_cup"),
    ("espresso_cup", "espresso_cup"),
    ("round_bowl", BIG_BOWL),
)
"""Cup and second container: a shorter cup into a bigger bowl, into smaller cups, into a square
bowl, from the tallest, the smallest and a wide one."""


def half_full_radius_m(cup: Container) -> float:
    """Radius of balls of which `N_BALLS` fill half of a container."""
    return ball_radius_m(0.5 * cup.inner_volume_m3, N_BALLS)


def container_named(name: str) -> Container:
    """One of the ten containers, or the bowl that is larger than all of them."""
    if name != BIG_BOWL:
        return make_container(name, CONTAINER_SEED)
    small, scale = SHAPES["round_bowl"], BIG_BOWL_SCALE
    lengths = {f: scale * getattr(small, f) for f in ("height_m", "base_m", "top_m")}
    return build_container(BIG_BOWL, replace(small, **lengths))
