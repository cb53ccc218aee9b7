# SPDX-License-Identifier: Apache-2.0
"""Parameters of all nodes, described once in `parameters.yaml` beside this file.

Nodes declare them (`nodes.parameters.declare`), launch files reject misspelt ones, and the
reference documentation lists them.
"""

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import yaml

_FILE = Path(__file__).with_name("parameters.yaml")

PARTS: Mapping[str, tuple[str, ...]] = {
    "mocap_ingest": ("mocap_ingest", "people", "frames"),
    "intent_estimator": ("lifecycle", "intent_estimator", "people", "hand", "via_points", "plan")
    + ("frames",),
    "primitive_activation": ("lifecycle", "activation", "people", "hand", "clearance", "person")
    + ("correction", "sequences"),
    "task_teacher": ("task_teacher", "practice"),
    "object_warper": ("object_warper", "frames"),
    "object_transfer": ("object_transfer", "hand", "people"),
    "warped_primitive": ("warped_primitive",),
    "dashboard": ("dashboard",),
    "bag_recorder": ("bag_recorder",),
    "bag_player": ("bag_player",),
    "arm_sim": ("arm", "robot", "pouring_scene", "people"),
    "lwr_sim": ("arm", "pouring_scene", "people"),
    "coworker_sim": ("coworker_sim", "people"),
}
"""Parts of `parameters.yaml` that a node declares, by the name of its executable."""


class ParameterSpec(NamedTuple):
    """A parameter of a node."""

    default: Any  # its type is that of the parameter
    description: str  # with the unit, and what a larger value does
    minimum: float | None = None  # smallest value allowed; None: any
    maximum: float | None = None  # largest value allowed; None: any
    live: bool = False  # whether it may change while the node runs
    # type if the default is an empty list: "string_array" or "double_array"
    kind: str = "string_array"
    one_of: tuple[str, ...] = ()  # allowed values; empty: any


@lru_cache(maxsize=1)
def parameter_parts() -> Mapping[str, Mapping[str, ParameterSpec]]:
    """All parameters, by part and name."""
    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    described = yaml.load(_FILE.read_text(encoding="utf-8"), loader)  # our own file
    return {
        part: {name: _spec(**fields) for name, fields in parameters.items()}
        for part, parameters in described.items()
    }


def parameters_of(node: str) -> dict[str, ParameterSpec]:
    """All parameters of one of our nodes, by name."""
    parts = parameter_parts()
    return {name: spec for part in PARTS[node] for name, spec in parts[part].items()}


def _spec(**fields: Any) -> ParameterSpec:
    minimum, maximum = fields.get("range", (None, None))
    kind = fields.get("type", "string_array")
    live = fields.get("live", False)
    one_of = tuple(fields.get("one_of", ()))
    return ParameterSpec(fields["default"], fields["is"], minimum, maximum, live, kind, one_of)
