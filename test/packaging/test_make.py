# SPDX-License-Identifier: Apache-2.0
"""The Makefile and the CI script do what the README promises, without running them."""

import os
import shutil
import subprocess

import pytest


@pytest.fixture
def dry_run(repository, tmp_path):
    """Function from a target to the commands make would run in a fresh checkout."""
    if shutil.which("make") is None:
        pytest.skip("make is not installed here")

    def run(target, *options):
        made = subprocess.run(
            ["make", "--dry-run", target, f"VENV={tmp_path}/venv", *options],
            cwd=repository,
            capture_output=True,
            text=True,
            check=True,
        )
        return made.stdout

    return run


@pytest.mark.parametrize("target", ["demo", "test", "lint", "bench", "venv"])
def test_every_target_makes_its_environment(dry_run, target):
    commands = dry_run(target)
    assert "-m venv" in commands
    assert "install --quiet -r requirements.txt" in commands


def test_the_site_has_its_generator_and_the_library_that_it_documents(dry_run):
    commands = dry_run("docs")
    assert "install --quiet -r requirements-docs.txt" in commands
    assert "install --quiet -r requirements.txt" in commands
    assert "sphinx -W --keep-going" in commands


def test_demo_runs_the_command_with_its_arguments(dry_run):
    assert "bin/intent demo --seed 3" in dry_run("demo", "DEMO_ARGS=--seed 3")


def test_continuous_integration_ends_with_the_tests(repository):
    script = repository / ".ci" / "run"
    assert os.access(script, os.X_OK)
    subprocess.run(["bash", "-n", str(script)], check=True)
    lines = script.read_text(encoding="utf-8").splitlines()
    assert "set -euo pipefail" in lines
    assert lines[-1].startswith("make test")
