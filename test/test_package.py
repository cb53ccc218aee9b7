# SPDX-License-Identifier: Apache-2.0
"""What the package says about itself agrees everywhere."""

import ast
import importlib
import json
import re
import sys
import xml.etree.ElementTree as ElementTree
from functools import cache
from pathlib import Path

import pytest
import yaml
from programs import output_of, python_says

import intent_recognition
from intent_recognition.extras import EXTRAS
from intent_recognition.nodes.graph import NODES
from intent_recognition.registry import NODES as REGISTERED

ROOT = Path(__file__).resolve().parents[1]
EXECUTABLES = {"intent", *REGISTERED}
CODE = ("intent_recognition", "sim_bridge", "experiments", "test", "launch", "benchmarks")


def python_files():
    folders = [path for folder in CODE for path in (ROOT / folder).rglob("*.py")]
    return sorted([*folders, *ROOT.glob("*.py")])


def setup_says(option):
    said = output_of(sys.executable, "setup.py", "--quiet", option)
    return said.strip().splitlines()[-1]


@pytest.fixture(scope="module")
def manifest():
    return ElementTree.parse(ROOT / "package.xml").getroot()


def test_versions_agree(manifest):
    assert manifest.findtext("version") == intent_recognition.__version__
    assert setup_says("--version") == intent_recognition.__version__
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["version"] == intent_recognition.__version__
    changelog = (ROOT / "CHANGELOG.rst").read_text(encoding="utf-8")
    assert re.search(r"^([\d.]+) \(", changelog, re.MULTILINE)[1] == intent_recognition.__version__


def test_the_first_line_of_every_file_is_the_licence():
    licence = "# SPDX-License-Identifier: Apache-2.0\n"
    wrong = [path for path in python_files() if not path.read_text("utf-8").startswith(licence)]
    assert wrong == []


def test_pins_are_exact():
    for path in sorted(ROOT.glob("requirements*.txt")):
        for line in path.read_text(encoding="utf-8").splitlines():
            if line and not line.startswith(("#", "-r ")):
                pin = line.partition("; python_version ")[0]
                assert re.fullmatch(r"[A-Za-z0-9._-]+(\[\w+\])?==[\w.]+", pin), line


def test_every_requirement_of_setup_is_pinned():
    pinned = {
        re.split(r"[\[=]", line)[0].lower()
        for line in (ROOT / "requirements.txt").read_text(encoding="utf-8").splitlines()
    }
    assert required(["all", "ros", "dtw"]) - {"pyarrow", "ezc3d", "h5py"} <= pinned


@cache
def setup_arguments():
    """What setup.py gives to setuptools."""
    code = (
        "import setuptools, json\n"
        "setuptools.setup = lambda **k: print(json.dumps({n: k[n] for n in"
        " ('entry_points', 'install_requires', 'extras_require')}))\n"
        "import setup"
    )
    return json.loads(python_says(code))


def required(extras=()):
    """Names of what setup.py asks for on this machine, lower case, with some extras."""
    arguments = setup_arguments()
    entries = [*arguments["install_requires"]]
    entries += [entry for extra in extras for entry in arguments["extras_require"][extra]]
    return {re.split(r"[\[<>=; ]", e)[0].lower() for e in entries if "!= 'x86_64'" not in e}


def test_readme_installs_on_a_jazzy_machine_what_rosdep_does_not(manifest):
    """Rosdep's pip keys fail on Ubuntu 24.04; the rest of its keys are packages there."""
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    keys = {element.text for element in manifest.iter("exec_depend")}
    skipped = re.search(r'--skip-keys "([^"]+)"', readme)[1].split()
    assert set(skipped) == {key for key in keys if key.endswith("-pip")}
    (lines,) = re.findall(r"^pip install (\w[^#]*mcap[^#]*) +#", readme, re.MULTILINE)
    by_rosdep = {"numpy", "pyyaml", "scipy"}  # its matplotlib is too old
    assert {"python3-numpy", "python3-yaml", "python3-scipy"} <= keys
    of_viser = {"msgspec", "websockets"}
    needed = required(["sim", "dashboard", "practice", "plots"]) - of_viser
    words = set(lines.replace("\\", "").replace('"matplotlib>=3.8"', "matplotlib").split())
    assert needed - by_rosdep == words - {'"numpy<2"'}  # what apt's SciPy takes


KEYS = {
    "rosbags": "python3-rosbags-pip", "yaml": "python3-yaml", "lazy_loader": "lazy-loader",
    "mcap_ros2": "mcap-ros2-support",
}  # fmt: skip


def imported_packages():
    """Top-level names imported by what is installed, but the standard library and itself."""
    for folder in ("intent_recognition", "sim_bridge", "launch"):
        for path in (ROOT / folder).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.Import):
                    yield from (alias.name.split(".")[0] for alias in node.names)
                elif isinstance(node, ast.ImportFrom) and node.level == 0:
                    yield node.module.split(".")[0]


@pytest.mark.slow
def test_everything_imported_is_declared(manifest):
    """In package.xml, or in setup.py for what rosdep does not know."""
    declared = {element.text for element in manifest.iter("exec_depend")}
    declared |= required().union(*EXTRAS.values())
    own = {*sys.stdlib_module_names, "intent_recognition", "sim_bridge", "experiments"}
    for name in sorted(set(imported_packages()) - own):
        key = KEYS.get(name, name)
        assert {key, f"python3-{key}"} & declared, name


def test_launch_files_start_only_what_is_declared(manifest):
    declared = {element.text for element in manifest.iter("exec_depend")}
    assert {spec.package for spec in NODES.values()} <= declared | {"intent_recognition"}


def test_every_executable_has_its_main():
    scripts = dict(s.split(" = ") for s in setup_arguments()["entry_points"]["console_scripts"])
    assert set(scripts) == EXECUTABLES
    for target in scripts.values():
        module, function = target.split(":")
        assert callable(getattr(importlib.import_module(module), function))
