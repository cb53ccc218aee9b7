# SPDX-License-Identifier: Apache-2.0
"""The tests run where ROS is sourced: beside its plug-ins of pytest, and under its linters."""

import subprocess
import sys

PLUGINS = {
    "launch_testing": "launch_testing",
    "launch_testing_ros": "launch_testing_ros_pytest_entrypoint",
    "launch_pytest": "launch_pytest",
}
"""Distributions of ROS 2 Jazzy, and the plug-ins of pytest they register."""


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
    command = [sys.executable, "-m", "pytest", "--collect-only", "-q", "test/gaussian/test_tube.py"]
    path = [str(tmp_path), *filter(None, sys.path)]
    run = subprocess.run(
        [*command, "-p", "no:cacheprovider"],
        cwd=repository,
        env={"PYTHONPATH": ":".join(path), "PATH": "/usr/bin:/bin", "HOME": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stdout + run.stderr
    assert "test_tube.py::" in run.stdout
