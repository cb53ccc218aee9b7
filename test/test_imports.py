# SPDX-License-Identifier: Apache-2.0
"""Imports run one way between rooms, and the library stays free of ROS, physics and plots.

A room is a folder with an `__init__.py`, also each folder of `sim_bridge/scenarios`. A room whose
`__init__.py` takes names from its files has a face: others import from the room, not its files.
"""

import ast
import graphlib
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest
from programs import python_says

ROOT = Path(__file__).resolve().parents[1]
LIBRARY, SIMULATION, EXPERIMENTS = "intent_recognition", "sim_bridge", "experiments"
BUILDINGS = (LIBRARY, SIMULATION, EXPERIMENTS)
STOREYS = (  # of the library, from the ground up; rooms of one storey may not form a cycle
    {"array_types", "errors", "extras", "share", "untrusted", "durable", "interrupts"}
    | {"plots", "registry", "parameter_table"},
    {"gaussian", "signals", "kinematics", "bags"},
    {"promp", "alignment", "tracking", "warping", "motion", "transfer"},
    {"filtering", "objects", "demonstrations", "composing", "plans"},
    {"learning", "recognition", "tables", "improvement"},
    {"activation", "model"},
    {"evaluation"},
    {"report"},
    {"nodes", "dashboard", "cli"},
)
STOREY = {room: storey for storey, rooms in enumerate(STOREYS) for room in rooms}
BESIDE = ("benchmarks", "docs", "examples")
SUITES = ("sim_bridge.scenarios",)
"""Folders whose own folders are rooms."""
MAY_USE_SIMULATION = {"cli"}
MAY_RUN_EXPERIMENTS = ("experiments", "intent_recognition.cli.experiments")
MAY_USE_ROS = {"nodes", "dashboard", "cli"}
MAY_PLOT = {"report", "plots"}
ROS = ("rclpy", "rosgraph_msgs", "builtin_interfaces", "rcl_interfaces", "launch", "launch_ros")
PHYSICS = ("pybullet", "pybullet_utils", "pybullet_data")
QUIETED = ("pybullet", "pybullet_utils")
"""They write to the standard streams when they are imported anywhere else."""
HEAVY = ("rclpy", "pybullet", "matplotlib", "viser", "pinocchio", "coal", "pyarrow", "c3d", "cma")
SLOW = ("scipy.signal", "scipy.stats")
"""Each node would start half a second later."""


class Import(NamedTuple):
    """One name that a file takes from a module of ours, or a module of others."""

    file: str
    module: str
    name: str


def module_name(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


@cache
def sources() -> dict[str, Path]:
    paths = (path for top in BUILDINGS for path in (ROOT / top).rglob("*.py"))
    return {module_name(path): path for path in sorted(paths)}


def room_of(module: str) -> str:
    """`intent_recognition.promp` of any module below it."""
    parts = module.split(".")
    depth = 3 if ".".join(parts[:2]) in SUITES else 2
    return ".".join(parts[:depth])


def storey_of(module: str) -> int:
    parts = module.split(".")
    return STOREY[parts[1]] if len(parts) > 1 else len(STOREYS)


@cache
def imports() -> tuple[Import, ...]:
    """What every file imports anywhere, also inside functions."""
    return tuple(found for module, path in sources().items() for found in _imports(module, path))


def _imports(file: str, path: Path) -> Iterator[Import]:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (Import(file, alias.name, "") for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{file}: relative imports are not used here"
            for alias in node.names:
                full = f"{node.module}.{alias.name}"
                is_module = full in sources()
                yield Import(
                    file, full if is_module else node.module, "" if is_module else alias.name
                )


def ours() -> list[Import]:
    return [found for found in imports() if found.module.split(".")[0] in BUILDINGS]


@cache
def face(room: str) -> tuple[str, ...]:
    """The names that a room takes from its files for others, in its stub where it is lazy."""
    init = sources().get(room)
    if init is None or init.name != "__init__.py":
        return ()
    stub = init.with_suffix(".pyi")
    tree = ast.parse((stub if stub.is_file() else init).read_text())
    taken = [node for node in tree.body if isinstance(node, ast.ImportFrom)]
    return tuple(alias.name for node in taken for alias in node.names)


def listed(violations: list[Import]) -> list[str]:
    return [f"{v.file} imports {v.module} {v.name}".rstrip() for v in violations]


def test_every_room_has_a_storey_and_says_what_it_is_for():
    rooms = {p.parent.name: p for p in (ROOT / LIBRARY).glob("*/__init__.py")}
    assert set(rooms) <= set(STOREY)
    inits = [p for top in BUILDINGS for p in (ROOT / top).rglob("__init__.py")]
    silent = [str(p) for p in inits if not ast.get_docstring(ast.parse(p.read_text()))]
    assert silent == []


@pytest.mark.slow
def test_no_import_points_upward():
    upward = [
        found
        for found in ours()
        if found.file.startswith(LIBRARY + ".")
        and found.module.startswith(LIBRARY + ".")
        and storey_of(found.module) > storey_of(found.file)
    ]
    assert listed(upward) == []


@pytest.mark.slow
def test_rooms_have_no_cycle():
    graph: dict[str, set[str]] = {}
    for found in ours():
        here, there = room_of(found.file), room_of(found.module)
        if here not in BUILDINGS:  # the public face imports from everywhere, lazily
            graph.setdefault(here, set()).update({there} - {here})
    list(graphlib.TopologicalSorter(graph).static_order())


def test_files_have_no_cycle():
    graph: dict[str, set[str]] = {name: set() for name in sources()}
    for found in ours():
        graph[found.file].add(found.module)
    for name in BUILDINGS:
        graph[name].clear()
    list(graphlib.TopologicalSorter(graph).static_order())


def test_rooms_import_from_a_room_not_from_its_files():
    inside = [
        found
        for found in ours()
        if found.file not in BUILDINGS
        and room_of(found.file) != (room := room_of(found.module))
        and found.module != room
        and face(room)
    ]
    assert listed(inside) == []


def test_a_face_offers_what_others_take():
    taken = {(one.module, one.name) for one in imports() if room_of(one.file) != one.module}
    for path in (p for top in (*BESIDE, "launch") for p in (ROOT / top).rglob("*.py")):
        taken |= {(found.module, found.name) for found in _imports(path.stem, path)}
    stub = ast.parse((ROOT / LIBRARY / "__init__.pyi").read_text())
    for node in (node for node in stub.body if isinstance(node, ast.ImportFrom)):
        taken |= {(f"{LIBRARY}.{node.module}", alias.name) for alias in node.names}
    offered = {(room, name) for room in sources() if room not in BUILDINGS for name in face(room)}
    assert sorted(offered - taken) == []


def knows_nodes(module: str) -> bool:
    """Whether it is a module of the library's uppermost storey."""
    return module.startswith(LIBRARY) and storey_of(module) == len(STOREYS) - 1


def test_ros_physics_plots_nodes_and_page_stay_in_their_rooms():
    wrong = []
    for found in imports():
        top, room = found.module.split(".")[0], (found.file.split(".") + [""])[1]
        in_library, in_simulation = map(found.file.startswith, (LIBRARY, SIMULATION))
        is_node = (in_library and room in MAY_USE_ROS) or found.file.startswith("sim_bridge.nodes")
        is_ros = top in ROS or top.endswith(("_msgs", "_srvs"))
        if (
            (in_library and top == SIMULATION and room not in MAY_USE_SIMULATION)
            or (top == EXPERIMENTS and not found.file.startswith(MAY_RUN_EXPERIMENTS))
            or (is_ros and not is_node)
            or (in_library and top in PHYSICS)
            or (found.module in SLOW and not found.file.startswith(EXPERIMENTS))
            or (top in QUIETED and not found.file.startswith("sim_bridge.physics"))
            or (top == "matplotlib" and in_library and room not in MAY_PLOT)
            or (top == "matplotlib" and in_simulation)
            or (top == "viser" and not (in_library and room == "dashboard"))
            or (in_simulation and not is_node and knows_nodes(found.module))
        ):
            wrong.append(found)
    assert listed(wrong) == []


def loaded_after_importing(modules: list[str]) -> list[str]:
    """Which of the heavy packages a fresh Python has loaded after importing `modules`."""
    code = (
        f"import importlib, sys\nfor name in {modules!r}: importlib.import_module(name)\n"
        f"print(*[name for name in {HEAVY + SLOW!r} if name in sys.modules])"
    )
    return python_says(code).split()


@pytest.mark.slow
@pytest.mark.parametrize("without", [("nodes", "dashboard")], ids=["all but nodes and page"])
def test_library_loads_nothing_heavy(without):
    names = [name for name in sources() if name.startswith(LIBRARY)]
    names = [name for name in names if (name.split(".") + [""])[1] not in without]
    assert loaded_after_importing(names) == []


def test_people_are_simulated_without_physics():
    assert loaded_after_importing(["sim_bridge.scenarios.assembly.session"]) == []


def test_a_public_name_of_a_class_means_one_thing():
    places: dict[str, set[str]] = {}
    for module, path in sources().items():
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                places.setdefault(node.name, set()).add(module)
    assert {name for name, modules in places.items() if len(modules) > 1} == set()
