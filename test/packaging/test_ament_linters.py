# SPDX-License-Identifier: Apache-2.0
"""The linters of ROS 2 where they are installed, with what differs here and why.

ament_copyright knows no licence by its SPDX line alone: test_package.py looks at those.
"""

import shutil

import pytest

pytestmark = pytest.mark.slow
CODE = ("intent_recognition", "sim_bridge", "launch", "setup.py")
NOT_OURS = {
    "D205": "the summary may be two lines",
    "D212": "it begins on the first line",
    "D402": "it may begin with a quantity and its shape",
    "D403": "a summary may begin with a name as it is written in code",
    "D415": "a summary may end with a colon",
    "D104": "a room may go without a docstring",
    "D105": "magic methods",
    "D107": "the class docstring documents the constructor",
}
"""Of pydocstyle's google convention; the same as in ruff.toml. Ament's own has no arguments."""


@pytest.fixture
def in_repository(repository, monkeypatch):
    monkeypatch.chdir(repository)


@pytest.mark.usefixtures("in_repository")
def test_flake8():
    linter = pytest.importorskip("ament_flake8.main", reason="ament_flake8 is not installed")
    config = "test/packaging/ament_flake8.ini"
    code, errors = linter.main_with_errors(argv=["--config", config, *CODE])
    assert code == 0, "\n".join(errors)


@pytest.mark.usefixtures("in_repository")
def test_pep257(capsys):
    linter = pytest.importorskip("ament_pep257.main", reason="ament_pep257 is not installed")
    rules = ["--convention", "google", "--add-ignore", *NOT_OURS, "--"]
    packages = [folder for folder in CODE if folder != "launch"]  # one function, known to all
    assert linter.main(argv=[*rules, *packages]) == 0, capsys.readouterr().out


@pytest.mark.usefixtures("in_repository")
def test_xmllint(capsys):
    """Of package.xml against its schema; the other XML files are those of tools."""
    linter = pytest.importorskip("ament_xmllint.main", reason="ament_xmllint is not installed")
    if shutil.which("xmllint") is None:
        pytest.skip("xmllint is not installed")
    assert linter.main(argv=["package.xml"]) == 0, capsys.readouterr().out
