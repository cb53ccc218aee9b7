# SPDX-License-Identifier: Apache-2.0
"""The linters of ROS 2 where they are installed, with what differs here (why: ruff.toml).

ament_copyright knows no licence by its SPDX line alone: test_package.py looks at those.
"""

import pytest

CODE = ("intent_recognition", "sim_bridge", "launch", "setup.py")
NOT_OURS = ["D205", "D212", "D402", "D403", "D415", "D104", "D105", "D107"]
"""Of pydocstyle's google convention. Ament's own has no arguments."""
LINTERS = {
    "flake8": ("--config", "test/packaging/ament_flake8.ini", *CODE),
    "pep257": ("--convention", "google", "--add-ignore", *NOT_OURS, "--")
    + tuple(folder for folder in CODE if folder != "launch"),  # one function, known to all
    "xmllint": ("package.xml",),  # the other XML files are those of tools
}


@pytest.mark.slow
@pytest.mark.parametrize("name", LINTERS)
def test_linter(name, repository, monkeypatch, capsys):
    linter = pytest.importorskip(f"ament_{name}.main", reason=f"ament_{name} is not installed")
    monkeypatch.chdir(repository)
    assert linter.main(argv=[*LINTERS[name]]) == 0, capsys.readouterr().out
