# SPDX-License-Identifier: Apache-2.0
"""Message packages of ROS that have no wheel, generated from `test/interfaces` and compiled.

    python test/ros_interfaces.py FOLDER [PACKAGE ...]

They have the names and fields of the real packages, as far as nodes use them, so that code which
imports those where they are installed runs here too. The generators come with the wheels of ROS.
"""

import contextlib
import importlib
import io
import json
import subprocess
import sys
import sysconfig
from pathlib import Path

import numpy as np
from rosidl_cli.command.helpers import generate_visibility_control_file

SOURCES = Path(__file__).parent / "interfaces"
PREFIX = Path(sys.prefix)
USED = (
    *("builtin_interfaces", "std_msgs", "geometry_msgs", "trajectory_msgs", "shape_msgs"),
    *("action_msgs", "service_msgs", "unique_identifier_msgs"),
)
"""Packages whose messages are fields of these."""
KINDS = (
    "generator_c",
    "generator_py",
    "typesupport_c",
    *("typesupport_fastrtps_c", "typesupport_introspection_c"),
)
LOOKED_FOR = ("rosidl_typesupport_fastrtps_c", "rosidl_typesupport_introspection_c")
"""Type supports that the middleware asks for, by the name of a library."""
RUNTIME = ("rosidl_runtime_c", *LOOKED_FOR, "rosidl_typesupport_c", "rmw")
GENERATORS = (
    ("rosidl_generator_c", "generate_c", ()),
    ("rosidl_typesupport_fastrtps_c", "generate_typesupport_fastrtps_c", ()),
    ("rosidl_typesupport_introspection_c", "generate_c", ()),
    ("rosidl_typesupport_c", "generate_c", (list(LOOKED_FOR),)),
    ("rosidl_generator_py.generate_py_impl", "generate_py", (["rosidl_typesupport_c"],)),
)
WITH_VISIBILITY = ("rosidl_generator_c", *LOOKED_FOR)


def build(package: str, folder: Path) -> None:
    """Make a package of `SOURCES` in `folder`, which is then to stand on `PYTHONPATH`."""
    work = folder / "build" / package
    idls = [_idl(path, package, work) for path in sorted((SOURCES / package).glob("*/*"))]
    typed = _Generation(package, idls, work, folder)
    hashes = typed.run("rosidl_generator_type_description", "generate_type_hash")
    by_stem = {Path(path).stem: path for path in hashes}
    typed.more = {"type_description_tuples": [f"{typed.name(i)}:{by_stem[i.stem]}" for i in idls]}
    for generator, function, extra in GENERATORS:
        typed.run(generator, function, *extra)
    _compile(package, work, folder)
    (folder / package / "__init__.py").touch()


class _Generation:
    """Calls generators as the build tools do: by a file of arguments."""

    def __init__(self, package: str, idls: list[Path], work: Path, folder: Path):
        self.package, self.idls, self.work, self.folder = package, idls, work, folder
        self.more: dict[str, list[str]] = {}

    def name(self, idl: Path) -> Path:
        return idl.relative_to(self.work)

    def run(self, module: str, function: str, *extra: object) -> list[str]:
        generator = module.partition(".")[0]
        templates = PREFIX / "share" / generator / "resource"
        output = self.work / generator / self.package
        if generator == "rosidl_generator_py":
            output = self.folder / self.package
        arguments = {
            "package_name": self.package,
            "output_dir": str(output),
            "template_dir": str(templates),
            "idl_tuples": [f"{self.work}:{self.name(idl)}" for idl in self.idls],
            "ros_interface_files": [str(idl) for idl in self.idls],
            "ros_interface_dependencies": [],
            "target_dependencies": [],
            "include_paths": [f"{used}:{PREFIX}/share/{used}" for used in USED],
            **self.more,
        }
        path = self.work / f"{generator}.json"
        path.write_text(json.dumps(arguments), encoding="utf-8")
        if generator in WITH_VISIBILITY:
            header = f"{generator}__visibility_control.h"
            generate_visibility_control_file(
                package_name=self.package,
                template_path=templates / f"{header}.in",
                output_path=output / "msg" / header,
            )
        return list(getattr(importlib.import_module(module), function)(str(path), *extra))


def _idl(path: Path, package: str, work: Path) -> Path:
    """An interface as IDL."""
    kind = path.suffix.lstrip(".")
    convert = getattr(importlib.import_module(f"rosidl_adapter.{kind}"), f"convert_{kind}_to_idl")
    root = SOURCES / package
    with contextlib.redirect_stdout(io.StringIO()):  # it tells what it reads
        return Path(convert(root, package, path.relative_to(root), work / path.parent.name))


def _compile(package: str, work: Path, folder: Path) -> None:
    """A module of Python with all code; libraries with the names that are looked for lead to it."""
    target = folder / package
    include = [
        *(work / generator for generator in (*RUNTIME, "rosidl_generator_c")),
        *(PREFIX / "include").iterdir(),
        *(PREFIX / "include", sysconfig.get_path("include"), np.get_include()),
    ]
    options = ["-O0", "-w", "-fPIC", *(f"-I{path}" for path in include)]
    for language, suffix in (("gcc", ".c"), ("g++", ".cpp")):
        for root in (target, *(work / generator for generator in (*RUNTIME, "rosidl_generator_c"))):
            if sources := list(root.rglob(f"*{suffix}")):
                own = work / "objects" / f"{root.name}{suffix}"  # some have one name
                own.mkdir(parents=True)
                subprocess.run([language, *options, "-c", *sources], cwd=own, check=True)
    module, common = f"{package}_s__rosidl_typesupport_c.so", f"lib{package}.so"
    names = [f"{used}__rosidl_{kind}" for used in USED for kind in KINDS]
    used = [f"-L{PREFIX}/lib", *(f"-l{name}" for name in (*names, *RUNTIME, "fastcdr"))]
    stubs = [f"lib{package}__{name}.so" for name in LOOKED_FOR]
    _link(target, common, [*(work / "objects").rglob("*.o"), *used])
    for stub in stubs:
        _link(target, stub, [common])
    _link(target, module, [common, *stubs])


def _link(target: Path, name: str, parts: list) -> None:
    where = [f"-Wl,-rpath,$ORIGIN:{PREFIX}/lib", f"-Wl,-soname,{name}", "-Wl,--no-as-needed"]
    subprocess.run(["g++", "-shared", "-o", name, *where, *parts], cwd=target, check=True)


if __name__ == "__main__":
    for name in sys.argv[2:] or sorted(path.name for path in SOURCES.iterdir()):
        build(name, Path(sys.argv[1]).resolve())
