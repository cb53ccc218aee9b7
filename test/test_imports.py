# SPDX-License-Identifier: Apache-2.0
"""Imports run one way, and the library stays free of ROS, physics, plots and the web page."""

import ast
import graphlib
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
LIBRARY = "intent_recognition"
TIERS = (
    {"errors"},
    {"gaussian", "kinematics"},
    {"promp", "alignment", "warping", "tracking"},
    {"experiments", "report", "storage"},
    {"nodes", "cli", "dashboard"},
)
TIER = {room: tier for tier, rooms in enumerate(TIERS) for room in rooms}
TOP = len(TIERS) - 1
MAY_USE_SIM_BRIDGE = {"experiments", "cli"}
ROS = ("rclpy", "rosgraph_msgs", "builtin_interfaces", "rcl_interfaces", "launch", "launch_ros")
HEAVY = ("rclpy", "pybullet", "matplotlib", "viser")


def sources():
    return sorted(path for top in (LIBRARY, "sim_bridge") for path in (ROOT / top).rglob("*.py"))


def module_name(path):
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imports(path):
    """Full names of the modules a file imports anywhere, also inside functions."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative imports are not used here"
            if node.module in (LIBRARY, "sim_bridge"):
                yield from (f"{node.module}.{alias.name}" for alias in node.names)
            else:
                yield node.module


def room_of(name):
    """Room of a module of the library; the package itself counts as `errors`."""
    parts = name.split(".")
    return parts[1] if len(parts) > 1 and parts[1] in TIER else "errors"


def is_ros(name):
    top = name.split(".")[0]
    return top in ROS or top.endswith(("_msgs", "_srvs"))


def violations(path):
    module = module_name(path)
    in_library = module.split(".")[0] == LIBRARY
    room = room_of(module) if in_library else None
    is_node = room in ("nodes", "dashboard") or module.startswith("sim_bridge.nodes")
    for name in imports(path):
        top = name.split(".")[0]
        if top == LIBRARY and in_library and TIER[room_of(name)] > TIER[room]:
            yield f"{module} imports {name}, which lies above it"
        if top == LIBRARY and not in_library and TIER[room_of(name)] == TOP and not is_node:
            yield f"{module} imports {name}: only nodes may"
        if top == "sim_bridge" and in_library and room not in MAY_USE_SIM_BRIDGE:
            yield f"{module} imports {name}: only {sorted(MAY_USE_SIM_BRIDGE)} may"
        if is_ros(name) and not is_node and room != "cli":
            yield f"{module} imports {name}: ROS belongs into nodes"
        if top in ("pybullet", "pybullet_utils", "pybullet_data") and in_library:
            yield f"{module} imports {name}: physics belongs into sim_bridge"
        if top == "matplotlib" and room != "report":
            yield f"{module} imports {name}: plots belong into report"
        if top == "viser" and room != "dashboard":
            yield f"{module} imports {name}: the page belongs into dashboard"


@pytest.mark.parametrize("path", sources(), ids=module_name)
def test_imports_point_downward(path):
    assert list(violations(path)) == []


def test_modules_have_no_cycle():
    paths = {module_name(path): path for path in sources()}
    graph = {name: set(imports(path)) & set(paths) - {name} for name, path in paths.items()}
    list(graphlib.TopologicalSorter(graph).static_order())


def test_every_room_has_a_tier():
    folders = {p.parent.name for p in (ROOT / LIBRARY).glob("*/__init__.py")}
    assert folders <= set(TIER)


def loaded_after_importing(modules):
    """Which of the heavy packages a fresh Python has loaded after importing `modules`."""
    code = (
        f"import importlib, sys\nfor name in {modules!r}: importlib.import_module(name)\n"
        f"print(*[name for name in {HEAVY!r} if name in sys.modules])"
    )
    run = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stderr
    return run.stdout.split()


def library_modules(*without):
    names = [module_name(path) for path in (ROOT / LIBRARY).rglob("*.py")]
    return sorted(
        name for name in names if room_of(name) not in without and not name.endswith("__main__")
    )


def test_package_and_rooms_load_nothing_heavy():
    rooms = [module_name(p) for p in (ROOT / LIBRARY).rglob("__init__.py")]
    assert loaded_after_importing(sorted(rooms)) == []


def test_library_modules_load_nothing_heavy():
    assert loaded_after_importing(library_modules("nodes", "dashboard", "report")) == []


def test_report_loads_no_ros_and_no_physics():
    assert set(loaded_after_importing(library_modules("nodes", "dashboard"))) <= {"matplotlib"}
