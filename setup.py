# SPDX-License-Identifier: Apache-2.0
"""One tree for pip, colcon and ros2 run; settings that colcon reads must stand here."""

import re
import runpy
import sys
from pathlib import Path

from setuptools import Distribution, Extension, find_packages, setup

PACKAGE = "intent_recognition"
SHARE = f"share/{PACKAGE}"
ROOT = Path(__file__).resolve().parent


# The limited API has had buffers since Python 3.11: from there on, one file serves all versions.
STABLE = sys.version_info >= (3, 11)


def extension(name: str, *flags: str) -> Extension:
    """An optional extension of one C file; without a compiler its Python twin serves."""
    return Extension(
        f"{PACKAGE}.{name}",
        [f"{PACKAGE}/{name.replace('.', '/')}.c"],
        define_macros=[("Py_LIMITED_API", "0x030b0000")] if STABLE else [],
        py_limited_api=STABLE,
        extra_compile_args=["-O3", *flags],
        optional=True,
    )


class DistributionWithDataFiles(Distribution):
    """Makes `pip install -e .` install the data files too."""

    def has_data(self):
        """Whether `install_data` runs."""
        return self.has_data_files()


def run(name: str) -> dict:
    """Names defined by a file of the package that imports nothing else of it."""
    return runpy.run_path(str(ROOT / PACKAGE / name))


def version() -> str:
    """The version, which stands in the package's `__init__.py`."""
    text = (ROOT / PACKAGE / "__init__.py").read_text(encoding="utf-8")
    return re.search(r'^__version__ = "([^"]+)"', text, re.MULTILINE)[1]


def tree(folder: str) -> list[tuple[str, list[str]]]:
    """Data files below `folder`, each in the same place below the share directory."""
    by_folder: dict[str, list[str]] = {}
    for path in sorted((ROOT / folder).rglob("*")):
        if path.is_file() and "__pycache__" not in path.parts:
            relative = path.relative_to(ROOT)
            by_folder.setdefault(f"{SHARE}/{relative.parent}", []).append(str(relative))
    return sorted(by_folder.items())


setup(
    name=PACKAGE,
    version=version(),
    description="Recognise a coworker's task from first motion and move the robot in time.",
    long_description=(ROOT / "README.md").read_text(encoding="utf-8")
    if (ROOT / "README.md").is_file()
    else "",
    long_description_content_type="text/markdown",
    license="Apache-2.0",
    maintainer="Intent recognition maintainers",
    maintainer_email="maintainers@example.org",
    python_requires=">=3.10",
    packages=find_packages(include=[f"{PACKAGE}*", "sim_bridge*"]),
    package_data={"": ["*.pyi", "py.typed", "parameters.yaml"]},
    ext_modules=[
        # No -ffast-math: infinities are meant. -fopenmp-simd lets the marked sums be vectorised.
        extension("gaussian._kernel", "-fno-math-errno", "-fopenmp-simd"),
        extension("bags.mcap._records"),
    ],
    options={"bdist_wheel": {"py_limited_api": "cp311"}} if STABLE else {},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (SHARE, ["package.xml"]),
        *tree("config"),
        *tree("launch"),
        *tree("bags"),
    ],
    install_requires=[
        "lazy-loader>=0.4",
        "lz4",
        "mcap>=1.1",
        "mcap-ros2-support>=0.5",
        "numpy>=1.26",
        "PyYAML",
        "rich",
        "rosbags>=0.10",
        "scipy>=1.11",
        "shtab>=1.13",
        "zstandard",
    ],
    extras_require={
        **run("extras.py")["requirements"](),
        # What `intent experiments alignment` compares with; it runs without.
        "dtw": ["dtaidistance>=2.3"],
        "docs": ["sphinx>=7", "myst-parser>=3", "furo", "matplotlib>=3.8", "sphinx-gallery>=0.17"],
        "test": ["pytest>=7", "pytest-cov", "pytest-xdist", "hypothesis", "playwright"],
    },
    zip_safe=False,
    entry_points={
        "console_scripts": [
            "intent = intent_recognition.cli.start:intent",
            *(f"{name} = {PACKAGE}.nodes.start:{name}" for name in run("registry.py")["NODES"]),
        ]
    },
    distclass=DistributionWithDataFiles,
)
