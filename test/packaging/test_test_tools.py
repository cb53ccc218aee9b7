# SPDX-License-Identifier: Apache-2.0
"""The tests run where ROS is sourced, beside its plug-ins of pytest, and without pybullet."""

import subprocess
import sys

PLUGINS = {
    "launch_testing": "launch_testing",
    "launch_testing_ros": "launch_testing_ros_pytest_entrypoint",
    "launch_pytest": "launch_pytest",
}
"""Distributions of ROS 2 Jazzy, and the plug-ins of pytest they register."""
WITHOUT_PYBULLET = """
import importlib.util

find = importlib.util.find_spec
importlib.util.find_spec = lambda name, *of: None if name == "pybullet" else find(name, *of)
"""
"""A plug-in of pytest that hides pybullet from `conftest.py`."""


def pytest_says(repository, path, *words):
    """What pytest says in a process of its own, with modules of a folder."""
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *words]
    modules = ":".join([str(path), *filter(None, sys.path)])
    run = subprocess.run(
        command,
        cwd=repository,
        env={"PYTHONPATH": modules, "PATH": "/usr/bin:/bin", "HOME": str(path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stdout + run.stderr
    return run.stdout


def test_plugins_of_ros_do_not_stop_pytest(repository, tmp_path):
    """Theirs have arguments that pytest 9 has no more, and hooks of one another."""
    hook = "def pytest_pycollect_makemodule(path, parent): pass\n"
    for distribution, plugin in PLUGINS.items():
        (tmp_path / f"{plugin}.py").write_text(hook, encoding="utf-8")
        metadata = tmp_path / f"{distribution}-3.4.0.dist-info"
        metadata.mkdir()
        of_it = f"Metadata-Version: 2.1\nName: {distribution}\nVersion: 3.4.0\n"
        (metadata / "METADATA").write_text(of_it, encoding="utf-8")
        entry = f"[pytest11]\n{plugin} = {plugin}\n"
        (metadata / "entry_points.txt").write_text(entry, encoding="utf-8")
    said = pytest_says(repository, tmp_path, "--collect-only", "test/gaussian/test_tube.py")
    assert "test_tube.py::" in said


def test_what_needs_pybullet_is_skipped_without_it(repository, tmp_path):
    (tmp_path / "without_pybullet.py").write_text(WITHOUT_PYBULLET, encoding="utf-8")
    files = "test/kinematics/test_bodies.py", "test/gaussian/test_tube.py"
    said = pytest_says(repository, tmp_path, "-p", "without_pybullet", *files)
    assert "pybullet is not installed" in said and "passed" in said
