# SPDX-License-Identifier: Apache-2.0
"""The tree builds with colcon and pip, and a node starts from there."""

import os
import sys
import sysconfig
from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from packaging_sources import copy_sources
from programs import output_of
from ros_harness import NodeProcess

from intent_recognition.gaussian import KERNEL
from intent_recognition.registry import NODES

pytestmark = pytest.mark.slow

EXECUTABLES = {"intent", *NODES}


@pytest.fixture(scope="module")
def workspace(repository, tmp_path_factory) -> Path:
    """A workspace with a copy of the package, without the bags."""
    folder = tmp_path_factory.mktemp("workspace")
    copy_sources(repository, folder / "src" / "intent_recognition", "LICENSE", "config", "launch")
    return folder


@pytest.fixture(scope="module")
def install(workspace) -> Path:
    """The install folder after `colcon build`."""
    colcon = Path(sys.prefix, "bin", "colcon")
    if not colcon.is_file():
        pytest.skip("colcon is not installed here (requirements-dev.txt)")
    output_of(colcon, "build", "--event-handlers", "console_direct+", cwd=workspace)
    return workspace / "install" / "intent_recognition"


def site_packages(install: Path) -> Path:
    (folder,) = install.glob("lib/python3*/site-packages")
    return folder


def test_colcon_installs_executables_and_data(install, repository):
    found = {path.name for path in (install / "lib" / "intent_recognition").iterdir()}
    assert found == EXECUTABLES
    share = install / "share"
    assert (share / "ament_index/resource_index/packages/intent_recognition").is_file()
    ours = share / "intent_recognition"
    assert (ours / "package.xml").is_file()
    for folder in ("config", "launch"):
        expected = files_below(repository / folder)
        assert files_below(ours / folder) == expected


def files_below(folder: Path) -> set[str]:
    """Paths of all files below a folder, relative to it."""
    found = {str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file()}
    return {path for path in found if "__pycache__" not in path}


def test_node_starts_from_the_colcon_install(install, harness):
    reports = harness.collect(DiagnosticArray, "/diagnostics")
    environment = {
        "PYTHONPATH": str(site_packages(install)),
        "AMENT_PREFIX_PATH": os.pathsep.join([str(install), sys.prefix]),
    }
    executable = install / "lib" / "intent_recognition" / "mocap_ingest"
    with NodeProcess(
        executable, "--ros-args", "-r", "__node:=from_colcon", environment=environment
    ) as node:
        harness.spin_until(
            lambda: any(s.name == "from_colcon" for report in reports for s in report.status),
            what="diagnostics of the node",
        )
        assert node.stop() == 0
    assert "Traceback" not in node.errors


@pytest.mark.parametrize("mode", [(), ("-e",)], ids=["install", "editable"])
def test_pip_puts_names_on_the_path(workspace, tmp_path, mode):
    """In a throw-away environment that sees the packages of this one; once without a compiler."""
    package = workspace / "src" / "intent_recognition"
    environment = tmp_path / "venv"
    output_of(sys.executable, "-m", "venv", "--without-pip", environment, cwd=tmp_path)
    python = environment / "bin" / "python"
    (target,) = environment.glob("lib/python3*/site-packages")
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--python", python]
    (target / "outer.pth").write_text(f"{outer_site_packages()}\n", encoding="utf-8")
    options = ["--no-deps", "--no-build-isolation", "--no-index", "--no-compile", "--quiet"]
    without = {} if mode else {"CC": "false"}
    output_of(*pip, "install", *options, *mode, package, cwd=tmp_path, **without)
    assert {path.name for path in (environment / "bin").iterdir()} >= EXECUTABLES
    share = environment / "share"
    assert (share / "intent_recognition/config/params.yaml").is_file()
    assert (share / "ament_index/resource_index/packages/intent_recognition").is_file()
    code = "from intent_recognition.share import share_path; print(share_path('config/dofs.yaml'))"
    where = output_of(python, "-c", code, cwd=tmp_path, PYTHONPATH="", AMENT_PREFIX_PATH="")
    assert where.startswith(str(package if mode else environment))
    if without:
        assert "update: numpy" in output_of(
            environment / "bin" / "intent", "--version", cwd=tmp_path
        )


def outer_site_packages() -> Path:
    """Where the packages of the running environment are."""
    return Path(pytest.__file__).resolve().parents[1]


@pytest.fixture
def sources(repository, tmp_path) -> Path:
    """What an install needs, but for what it only copies."""
    folder = tmp_path / "source"
    copy_sources(repository, folder)
    for name in ("config", "launch"):
        (folder / name).mkdir()
    return folder


@pytest.mark.skipif(KERNEL != "c" or sys.platform != "linux", reason="no compiler")
@pytest.mark.parametrize(
    ("source", "test"),
    [
        ("gaussian/_kernel.c", "gaussian/test_batch.py"),
        ("bags/mcap/_records.c", "bags/test_records.py"),
    ],
)
def test_the_tests_of_compiled_code_pass_with_sanitizers(sources, repository, source, test):
    """Of addresses and of undefined behaviour; numpy's own leaks are not looked at."""
    compiler = sysconfig.get_config_var("CC").split()[0]
    source = sources / "intent_recognition" / source
    flags = ["-O0", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
    build = ["-shared", "-fPIC", "-fopenmp-simd", "-DPy_LIMITED_API=0x030b0000"]
    include = f"-I{sysconfig.get_paths()['include']}"
    compile_ = [compiler, *flags, *build, include, source, "-o", source.with_suffix(".abi3.so")]
    output_of(*compile_, cwd=sources)
    library = output_of(compiler, "-print-file-name=libasan.so").strip()
    environment = {"LD_PRELOAD": library, "ASAN_OPTIONS": "detect_leaks=0"}
    tests = [repository / "test" / test, "-p", "no:cacheprovider"]
    chosen = ["-m", "not slow", "-k", "not can_be_chosen"]  # in processes of its own
    pytest_ = [sys.executable, "-m", "pytest", "-q", *chosen]  # of the folder it is in
    found = output_of(*pytest_, *tests, cwd=sources, **environment)
    assert " passed" in found and "skipped" not in found
