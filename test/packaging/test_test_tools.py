# SPDX-License-Identifier: Apache-2.0
"""The tests run beside ROS's plug-ins and without pybullet, and ROS's linters pass."""

import subprocess
import sys

import pytest

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


def test_plugins_of_ros_do_not_stop_pytest_and_what_needs_pybullet_is_skipped_without_it(
    repository, tmp_path
):
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
    (tmp_path / "without_pybullet.py").write_text(WITHOUT_PYBULLET, encoding="utf-8")
    files = "test/kinematics/test_bodies.py", "test/gaussian/test_tube.py"
    options = ("-q", "-p", "no:cacheprovider", "-p", "without_pybullet")
    modules = ":".join([str(tmp_path), *filter(None, sys.path)])
    environment = {"PYTHONPATH": modules, "PATH": "/usr/bin:/bin", "HOME": str(tmp_path)}
    command = [sys.executable, "-m", "pytest", *options, *files]
    run = subprocess.run(command, cwd=repository, env=environment, capture_output=True, text=True)
    assert run.returncode == 0, run.stdout + run.stderr
    assert "pybullet is not installed" in run.stdout and "passed" in run.stdout


CODE = ("intent_recognition", "sim_bridge", "launch", "setup.py")
NOT_OURS = ["D205", "D212", "D402", "D403", "D415", "D104", "D105", "D107"]
"""Of pydocstyle's google convention. Ament's own has no arguments."""
LINTERS = {
    "flake8": ("--config", "test/packaging/ament_flake8.ini", *CODE),
    "pep257": ("--convention", "google", "--add-ignore", *NOT_OURS, "--")
    + tuple(folder for folder in CODE if folder != "launch"),  # one function, known to all
    "xmllint": ("package.xml",),  # the other XML files are those of tools
}
"""Not ament_copyright, which wants a notice with a year in each file: ours name the licence."""


@pytest.mark.slow
@pytest.mark.parametrize("name", LINTERS)
def test_linter(name, repository, monkeypatch, capsys):
    linter = pytest.importorskip(f"ament_{name}.main", reason=f"ament_{name} is not installed")
    monkeypatch.chdir(repository)
    assert linter.main(argv=[*LINTERS[name]]) == 0, capsys.readouterr().out
