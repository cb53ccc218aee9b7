# SPDX-License-Identifier: Apache-2.0
"""Optional packages by extra: setup.py reads them, and error messages name them.

The library itself needs only numpy, scipy and small packages. This file imports nothing from this
package, so that setup.py can run it before anything is installed.
"""

from collections.abc import Mapping

MESHES = {
    "trimesh": "trimesh>=4",
    "embreex": "embreex; platform_machine == 'x86_64'",
    "rtree": "rtree; platform_machine != 'x86_64'",
}
MOTION = {"ruckig": "ruckig>=0.19"}
BULLET = ("pybullet", "pybullet_data", "pybullet_utils")
EXTRAS: Mapping[str, Mapping[str, str]] = {
    "sim": {**dict.fromkeys(BULLET, "pybullet>=3.2.5"), **MESHES, **MOTION},
    "ros": {
        "rclpy": "ros-rclpy[fastrtps]==7.1.6",
        "std_msgs": "ros-common-interfaces==5.3.6",
        "rmw_fastrtps_cpp": "ros-rmw-fastrtps-cpp==8.4.3",
        **MOTION,
    },
    "dashboard": {
        "viser": "viser>=1.0",
        "msgspec": "msgspec>=0.18",
        "websockets": "websockets>=13.0",
        "yourdfpy": "yourdfpy>=0.0.56",
        **MESHES,
    },
    "arms": {
        "pinocchio": "pin>=3.0",
        "coal": "coal>=3.0",
        "xacro": "xacro>=2.0",
        **MESHES,
        **MOTION,
    },
    "meshes": MESHES,
    "motion": MOTION,
    "plots": {"matplotlib": "matplotlib>=3.8"},
    "practice": {"cma": "cma>=3.2"},
    "files": {"pyarrow": "pyarrow>=14", "ezc3d": "ezc3d>=1.5", "h5py": "h5py>=3.9"},
    "dask": {"distributed": "distributed>=2024.1"},
}
"""For each extra, the imported modules and their names for pip."""
NOT_IN_ALL = ("ros", "dask")
"""Extras that `all` does not contain: ROS may be sourced instead, and clusters are rare."""


def requirements() -> dict[str, list[str]]:
    """The extras in the form for pip, and `all`, which combines them."""
    extras = {extra: sorted(set(needed.values())) for extra, needed in EXTRAS.items()}
    chosen = (needed for extra, needed in extras.items() if extra not in NOT_IN_ALL)
    return {**extras, "all": sorted({one for needed in chosen for one in needed})}


def installing(module: str) -> tuple[str, str] | None:
    """Pip name of an optional module's package, and the smallest extra that contains it."""
    found = [(len(needed), extra) for extra, needed in EXTRAS.items() if module in needed]
    if not found:
        return None
    extra = min(found)[1]
    requirement = EXTRAS[extra][module]
    return requirement.partition(";")[0].split(">")[0].split("=")[0], extra
