# SPDX-License-Identifier: Apache-2.0
"""The compiled update: an install without a compiler, and its tests under sanitizers."""

import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

from intent_recognition.gaussian import KERNEL

pytestmark = pytest.mark.slow
SOURCES = ("package.xml", "setup.py", "setup.cfg", "pyproject.toml", "resource")


@pytest.fixture
def sources(repository, tmp_path) -> Path:
    """What an install needs, but for what it only copies."""
    folder = tmp_path / "source"
    folder.mkdir()
    skip = shutil.ignore_patterns("__pycache__", "*.egg-info", "*.so")
    for name in ("intent_recognition", "sim_bridge", *SOURCES):
        if (repository / name).is_dir():
            shutil.copytree(repository / name, folder / name, ignore=skip)
        else:
            shutil.copy(repository / name, folder / name)
    for name in ("config", "launch"):
        (folder / name).mkdir()
    return folder


def run(folder: Path, *command: object, **environment: str) -> str:
    found = subprocess.run(
        [str(word) for word in command],
        cwd=folder,
        env=os.environ | environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert found.returncode == 0, found.stdout + found.stderr
    return found.stdout


def test_without_a_compiler_it_installs_and_numpy_serves(sources, tmp_path):
    target = tmp_path / "installed"
    options = ["--no-deps", "--no-build-isolation", "--no-index", "--no-compile", "--quiet"]
    pip = [sys.executable, "-m", "pip", "install", "--target", target]
    run(tmp_path, *pip, *options, sources, CC="false")
    code = "from intent_recognition.cli.main import main; main(['--version'])"
    assert "update: numpy" in run(target, sys.executable, "-c", code)


@pytest.mark.skipif(KERNEL != "c" or sys.platform != "linux", reason="no compiler")
def test_the_tests_of_the_update_pass_with_sanitizers(sources, repository):
    """Of addresses and of undefined behaviour; numpy's own leaks are not looked at."""
    compiler = sysconfig.get_config_var("CC").split()[0]
    source = sources / "intent_recognition" / "gaussian" / "_kernel.c"
    flags = ["-O1", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
    build = ["-shared", "-fPIC", "-fopenmp-simd", "-DPy_LIMITED_API=0x030b0000"]
    include = f"-I{sysconfig.get_paths()['include']}"
    run(sources, compiler, *flags, *build, include, source, "-o", source.with_suffix(".abi3.so"))
    library = run(sources, compiler, "-print-file-name=libasan.so").strip()
    environment = {"LD_PRELOAD": library, "ASAN_OPTIONS": "detect_leaks=0", "INTENT_KERNEL": "c"}
    tests = [repository / "test" / "gaussian" / "test_batch.py", "-p", "no:cacheprovider"]
    pytest_ = [sys.executable, "-m", "pytest", "-q", "-m", "not slow"]  # of the folder it is in
    found = run(sources, *pytest_, *tests, **environment)
    assert " passed" in found and "skipped" not in found
