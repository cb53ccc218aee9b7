# SPDX-License-Identifier: Apache-2.0
"""ROS packages that a robot's description speaks of: installed, or as source around its file."""

import os
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory

from intent_recognition.untrusted import UntrustedError, load_xml, read_text

_PREFIXES = "AMENT_PREFIX_PATH"
_NAME = re.compile(r"\w[\w-]*")
"""The name of a package. Others may be paths, of which no link is made."""


def package_shares() -> list[str]:
    """Folders in which the installed packages of `package://` are."""
    return [str(Path(prefix) / "share") for prefix in _prefixes()]


def packages_around(folder: Path) -> dict[str, Path]:
    """Packages by name whose folders are above a folder, or stand beside those: a clone's."""
    found: dict[str, Path] = {}
    for above in (folder, *folder.parents[:3]):  # `urdf`, its package, what holds it
        with suppress(OSError):
            for place in (above, *sorted(above.iterdir())):
                with suppress(OSError, UntrustedError):
                    name = load_xml(read_text(place / "package.xml")).findtext("name", "").strip()
                    if _NAME.fullmatch(name):
                        found.setdefault(name, place)
    return found


@contextmanager
def as_installed(packages: Mapping[str, Path]) -> Iterator[str]:
    """The value of AMENT_PREFIX_PATH with which these packages are found, behind those installed.

    They are links in a prefix of ament's form, which lasts as long as the context.
    """
    with TemporaryDirectory(prefix="intent_packages_") as prefix:
        index = Path(prefix, "share", "ament_index", "resource_index", "packages")
        index.mkdir(parents=True)
        for name, folder in packages.items():
            (index / name).touch()
            Path(prefix, "share", name).symlink_to(folder.resolve())
        yield os.pathsep.join([*_prefixes(), prefix])


def _prefixes() -> list[str]:
    return [prefix for prefix in os.environ.get(_PREFIXES, "").split(os.pathsep) if prefix]
