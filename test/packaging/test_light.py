# SPDX-License-Identifier: Apache-2.0
"""What `pip install .` brings is enough for the library, small, and says what else there is.

The environment is put together from the packages installed here: those that setup.py asks for
without extras, what they ask for, and nothing else.
"""

import os
import re
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging_sources import copy_sources

from intent_recognition.extras import EXTRAS

pytestmark = pytest.mark.slow

LARGEST = 250e6
"""Bytes of all packages without pip and the byte code that Python keeps beside them."""
ASKING = """
import sys
from intent_recognition.errors import MissingPackageError, optional
for module in sys.argv[1:]:
    try:
        optional(module)
        print(module, "is here")
    except MissingPackageError as error:
        print(error)
"""


def needed(name: str, found: dict[str, metadata.Distribution]) -> None:
    """Add a distribution and what it needs."""
    if name not in found:
        found[name] = metadata.distribution(name)
        for requirement in map(Requirement, found[name].requires or ()):
            if requirement.marker is None or requirement.marker.evaluate({"extra": ""}):
                needed(requirement.name.lower().replace("_", "-"), found)


@pytest.fixture(scope="module")
def packages() -> dict[str, metadata.Distribution]:
    found: dict[str, metadata.Distribution] = {}
    needed("intent-recognition", found)
    del found["intent-recognition"]
    return found


@pytest.fixture(scope="module")
def python(packages, repository, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("light")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder / "venv"], check=True)
    (target,) = folder.glob("venv/lib/python3*/site-packages")
    for distribution in packages.values():
        for file in distribution.files or ():
            if ".." not in file.parts:
                (target / file).parent.mkdir(parents=True, exist_ok=True)
                there = Path(str(distribution.locate_file(file))).resolve()
                (target / file).symlink_to(there)
    source = folder / "source"
    copy_sources(repository, source, "config", "launch")
    interpreter = folder / "venv" / "bin" / "python"
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--target", target]
    options = ["--no-deps", "--no-build-isolation", "--no-index", "--no-compile"]
    subprocess.run([*pip, *options, source], check=True, cwd=folder)
    return interpreter


def run(python: Path, *words: object) -> subprocess.CompletedProcess:
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    command = [str(word) for word in (python, *words)]
    return subprocess.run(
        command, capture_output=True, text=True, cwd=python.parent, env=environment, check=False
    )


def test_it_is_small(packages):
    sizes = {
        name: sum(
            Path(str(one.locate_file(file))).stat().st_size
            for file in one.files or ()
            if file.suffix != ".pyc" and one.locate_file(file).is_file()
        )
        for name, one in packages.items()
    }
    assert sum(sizes.values()) < LARGEST, sorted(sizes.items(), key=lambda item: -item[1])


def test_it_learns_recognises_and_names_what_is_missing(python, repository):
    """The README's program prints what the README shows."""
    modules = sorted({module for extra in EXTRAS.values() for module in extra})
    readme = (repository / "README.md").read_text(encoding="utf-8")
    part = readme.split("## Use it as a library\n", 1)[1].split("\n## ", 1)[0]
    program, shown = (
        re.search(rf"^```{kind}\n(.*?)^```", part, re.MULTILINE | re.DOTALL)[1]
        for kind in ("python", "text")
    )
    said = run(python, "-c", program + ASKING, *modules)
    assert said.returncode == 0, said.stderr
    printed, *missing = said.stdout.splitlines()
    task, numbers = re.compile(r"s: (\w+), "), re.compile(r"-?\d+\.\d+")
    assert task.search(printed)[1] == task.search(shown)[1]
    ours, theirs = ([float(one) for one in numbers.findall(text)] for text in (printed, shown))
    assert ours == pytest.approx(theirs, abs=0.03)
    for module, line in zip(modules, missing, strict=True):
        assert line.startswith(f"{module}: expected ") and "pip install " in line


@pytest.mark.parametrize(
    ("words", "missing"),
    [
        (("train", "BAGS", "--output", "m.npz"), ""),
        (("replay", "BAGS/plate_handover_00", "--model", "m.npz"), ""),
        (("evaluate", "BAGS", "--report", "r.html"), "pip install matplotlib"),
        (("warp", "mug", "BAGS/mug.obj"), "pip install trimesh"),
        (("demo",), "pip install .[ros]"),
        (("experiments",), "Clone the repository"),
    ],
    ids=lambda value: value[0] if isinstance(value, tuple) else "",
)
def test_commands_run_or_name_what_they_need(python, repository, tmp_path, words, missing):
    """In one line."""
    bags = tmp_path / "bags"
    for bag in sorted((repository / "bags/toolbox/train").glob("*_0[01]")):
        bags.mkdir(exist_ok=True)
        (bags / bag.name).symlink_to(bag)
    (bags / "mug.obj").write_text("")
    words = [word.replace("BAGS", str(bags)) for word in words]
    said = run(python, *python.parents[1].glob("lib/*/site-packages/bin/intent"), *words)
    assert said.returncode == (1 if missing else 0), said.stderr
    assert missing in said.stderr and len(said.stderr.splitlines()) == bool(missing)
