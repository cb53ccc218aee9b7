# SPDX-License-Identifier: Apache-2.0
"""Quality of service as rosbag2 writes it into a bag, as plain values."""

from collections.abc import Mapping

from intent_recognition.untrusted import UntrustedError, load_yaml

NO_LIMIT = {"sec": 9223372036, "nsec": 854775807}
"""The longest duration (2^63 - 1 ns), by which rmw means an infinite one."""
OLD_NUMBERS = {  # rmw's enumerations, as bags older than version 9 hold them
    "reliability": {1: "reliable", 2: "best_effort"},
    "durability": {1: "transient_local", 2: "volatile"},
    "history": {1: "keep_last", 2: "keep_all"},
}


def rosbag2_profile(reliability: str, durability: str, depth: int) -> dict[str, object]:
    """One entry of `offered_qos_profiles`.

    Args:
        reliability: "reliable" or "best_effort".
        durability: "transient_local" or "volatile".
        depth: of the history kept; 0 when unknown.
    """
    return {
        "history": "keep_last" if depth else "unknown",
        "depth": depth,
        "reliability": reliability,
        "durability": durability,
        "deadline": dict(NO_LIMIT),
        "lifespan": dict(NO_LIMIT),
        "liveliness": "automatic",
        "liveliness_lease_duration": dict(NO_LIMIT),
        "avoid_ros_namespace_conventions": False,
    }


def parse_qos(profiles: object) -> tuple[Mapping, ...]:
    """The list of QoS profiles, whether written as YAML (version 9) or as a text of YAML."""
    if isinstance(profiles, str):
        try:
            profiles = load_yaml(profiles)
        except UntrustedError:
            return ()
    listed = profiles if isinstance(profiles, list) else ()
    return tuple(p for p in listed if isinstance(p, Mapping))


def qos_policy(profile: Mapping, key: str) -> str:
    """Reliability, durability or history of a profile as a word, "" when it does not say."""
    value = profile.get(key)
    return OLD_NUMBERS[key].get(value, "") if isinstance(value, int) else str(value or "")
