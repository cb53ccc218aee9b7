# SPDX-License-Identifier: Apache-2.0
"""Arms, objects and small texts that no exporter writes, and whole ones to be spoiled.

Each generator first yields what was thought of, then whole ones with random faults, without end.
"""

import json
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from hostile.strangers import YAMLS, mutated, spoiled

SHIPPED_SUFFIXES = (".stl", ".ply", ".obj", ".off", ".xyz")
NUMBERS = (
    *("nan", "inf", "-inf", "1e400", "1e300", "-1e300", "1e-300", "-1", "0", "", "x", "1 2 3 4"),
    *("0 0 0", "1e300 1e300 1e300", "nan nan nan", "9" * 5000, "0x10", "\u0661", "1,5"),
)
NAMES = ("", "world", "link0", "joint1", "\x9b31m", "x" * 5000, "../..", "universe", "a b")
MESHES = (
    *("", ".", "/dev/zero", "fifo.stl", "../../../../etc/passwd", "file:///etc/passwd", "loop.stl"),
    *("x" * 5000 + ".stl", "http://localhost/x.stl", "package://../../etc/passwd", "%2e%2e/x.stl"),
    *("broken.stl", "broken.obj", "broken.dae", "package://", "box.stl"),
)
LAUGHS = "<!DOCTYPE r [<!ENTITY a0 'ha'>{}]>".format(
    "".join(f"<!ENTITY a{k + 1} '{f'&a{k};' * 10}'>" for k in range(12))
)


def arm(n=4):
    """A chain of n joints with a mesh, as a tree."""
    robot = ET.Element("robot", name="arm")
    for k in range(n + 1):
        link = ET.SubElement(robot, "link", name=f"link{k}")
        inertial = ET.SubElement(link, "inertial")
        ET.SubElement(inertial, "origin", xyz="0 0 0.1", rpy="0 0 0")
        ET.SubElement(inertial, "mass", value="1.0")
        inertia = {"ixx": "0.1", "iyy": "0.1", "izz": "0.1", "ixy": "0", "ixz": "0", "iyz": "0"}
        ET.SubElement(inertial, "inertia", inertia)
        shape = ET.SubElement(link, "collision")
        ET.SubElement(shape, "origin", xyz="0 0 0.1", rpy="0 0 0")
        geometry = ET.SubElement(shape, "geometry")
        if k == 1:
            ET.SubElement(geometry, "mesh", filename="box.stl", scale="1 1 1")
        else:
            ET.SubElement(geometry, "cylinder", radius="0.03", length="0.2")
    for k in range(1, n + 1):
        joint = ET.SubElement(robot, "joint", name=f"joint{k}", type="revolute")
        ET.SubElement(joint, "origin", xyz="0 0 0.3", rpy="0 0 0")
        ET.SubElement(joint, "parent", link=f"link{k - 1}")
        ET.SubElement(joint, "child", link=f"link{k}")
        ET.SubElement(joint, "axis", xyz="0 0 1" if k == 1 else "0 1 0")
        ET.SubElement(joint, "limit", lower="-2.5", upper="2.5", velocity="2", effort="50")
    return robot


def arms(rng):
    """URDF texts."""
    whole = ET.tostring(arm(), encoding="unicode")
    joint = whole[whole.index("<joint") :].removesuffix("</robot>")
    yield whole
    yield LAUGHS + whole.replace("arm", "&a12;", 1)
    yield LAUGHS + whole.replace("<mass", "&a12;<mass", 1)
    yield '<!DOCTYPE r [<!ENTITY a "' + "x" * 100_000 + '">]>' + f"<robot>{'&a;' * 100_000}</robot>"
    for outside in ("file:///etc/passwd", "/dev/zero", "fifo.stl", "http://localhost/x"):
        entity = f'<!DOCTYPE r [<!ENTITY a SYSTEM "{outside}">]>'
        yield entity + whole.replace("arm", "&a;", 1)
        yield entity + whole.replace("<mass", "&a;<mass", 1)
        yield f'<!DOCTYPE robot SYSTEM "{outside}">' + whole
        yield f'<!DOCTYPE r [<!ENTITY % a SYSTEM "{outside}"> %a;]>' + whole
        included = f'<xi:include xmlns:xi="http://www.w3.org/2001/XInclude" href="{outside}"/>'
        yield whole.replace("<link", f"{included}<link", 1)
    for encoding in ("utf-16", "utf-7", "x-none", "latin-1", "utf-32", "\x9b"):
        yield f'<?xml version="1.0" encoding="{encoding}"?>' + whole
    yield "\ufeff" + whole
    yield from ("", "<", "<robot>", "<robot/>", "<robot><link/></robot>", "<a/>", "\0")
    yield "<robot>" * 99
    yield "<robot>" + "<link>" * 200_000 + "</link>" * 200_000 + "</robot>"
    yield "<robot>" + "<link name='a'>" + "<visual>" * 3000 + "</visual>" * 3000 + "</link></robot>"
    yield "<robot>" + "<link name='a'/>" * 300_000 + "</robot>"
    yield "<robot>" + "".join(f"<link name='l{k}'/>" for k in range(200_000)) + "</robot>"
    yield f"<robot name='{'x' * 30_000_000}'><link name='a'/></robot>"
    yield "<robot " + " ".join(f"a{k}='1'" for k in range(300_000)) + "><link name='a'/></robot>"
    for n in (300, 3000, 20_000):
        yield ET.tostring(arm(n), encoding="unicode")
    yield "x" * 1000
    yield "/etc/passwd"
    yield joint
    yield whole.replace("</robot>", joint + "</robot>")
    for a, b in (("link4", "link0"), ("link4", "link1"), ("link2", "link1"), ("link0", "link4")):
        yield whole.replace(f'child link="{a}"', f'child link="{b}"')
        yield whole.replace(f'parent link="{a}"', f'parent link="{b}"')
        yield whole.replace(f'link name="{a}"', f'link name="{b}"')
    for master in ("joint1", "joint2", "joint3", "none", ""):
        for factor in ("1", "0", "nan", "1e300", "1e-300", "-1"):
            mimic = f'<mimic joint="{master}" multiplier="{factor}" offset="{factor}"/>'
            yield whole.replace('<axis xyz="0 1 0" />', f'<axis xyz="0 1 0" />{mimic}', 1)
    for mesh in MESHES:
        yield whole.replace("box.stl", mesh)
    while True:
        root = arm(int(rng.integers(1, 5)))
        for _ in range(int(rng.integers(1, 4))):
            _spoil(rng, root)
        text = ET.tostring(root, encoding="unicode")
        if rng.random() < 0.2:
            text = mutated(rng, text.encode()).decode("latin-1")
        yield text


def _spoil(rng, root):
    """One fault in a tree."""
    parents = list(root.iter())
    parent = parents[int(rng.integers(len(parents)))]
    kind, keys = rng.integers(6), sorted(parent.attrib)
    if kind == 0 and len(parent):
        parent.remove(parent[int(rng.integers(len(parent)))])
    elif kind == 1 and len(parent):
        parent.append(parent[int(rng.integers(len(parent)))])
    elif kind == 2 and keys:
        del parent.attrib[str(rng.choice(keys))]
    elif keys:
        key = str(rng.choice(keys))
        values = {"filename": MESHES, "name": NAMES, "link": NAMES, "joint": NAMES}.get(
            key, NUMBERS
        )
        if key == "type":
            values = ("continuous", "prismatic", "fixed", "floating", "planar", "", "x")
        parent.set(key, values[int(rng.integers(len(values)))])


def cup(n=24):
    """An open cup: vertices, and triangles of its wall and bottom, inside and outside."""
    turn = 2.0 * np.pi * np.arange(n) / n
    rings = [(0.040, 0.0), (0.040, 0.1), (0.036, 0.1), (0.036, 0.004)]
    vertices = [
        np.column_stack([r * np.cos(turn), r * np.sin(turn), np.full(n, z)]) for r, z in rings
    ]
    vertices = np.vstack([*vertices, [[0.0, 0.0, 0.0], [0.0, 0.0, 0.004]]])
    k, following = np.arange(n), (np.arange(n) + 1) % n
    faces = []
    for ring in range(3):
        a, b, c, d = (row * n + at for row in (ring, ring + 1) for at in (k, following))
        faces += [np.column_stack([a, b, d]), np.column_stack([a, d, c])]
    faces += [np.column_stack([np.full(n, 4 * n), following, k])]
    faces += [np.column_stack([np.full(n, 4 * n + 1), 3 * n + k, 3 * n + following])]
    return vertices, np.vstack(faces)


def written(vertices, faces, suffix):
    """Vertices and triangles as a file."""
    if suffix == ".xyz":
        return "\n".join(" ".join(map(repr, row)) for row in vertices.tolist() * 4).encode()
    mesh = pytest.importorskip("trimesh").Trimesh(vertices, faces, process=False)
    options = {"encoding": "ascii"} if suffix == ".ply" else {}
    with np.errstate(all="ignore"):
        content = mesh.export(file_type=suffix[1:], **options)
    return content if isinstance(content, bytes) else content.encode()


def targets(rng):
    """Suffixes and contents of meshes and clouds."""
    whole = cup()
    for suffix in SHIPPED_SUFFIXES:
        yield suffix, written(*whole, suffix)
    obj = written(*whole, ".obj")
    for outside in ("/dev/zero", "fifo.stl", "../../../etc/passwd", "huge", "x" * 5000, "."):
        material = f"mtllib {outside}\nusemtl a\n".encode()
        yield ".obj", material + obj
        own = b"own_fifo.mtl" if outside == "fifo.stl" else b"own_zero.mtl"
        yield ".obj", b"mtllib " + own + b"\n" + obj
        texture = f"ply\nformat ascii 1.0\ncomment TextureFile {outside}\n".encode()
        yield ".ply", written(*whole, ".ply").replace(b"ply\nformat ascii 1.0\n", texture)
        buffers = [{"uri": outside, "byteLength": 9}]
        yield ".gltf", json.dumps({"asset": {"version": "2.0"}, "buffers": buffers}).encode()
    yield ".dae", f"{LAUGHS}<COLLADA>&a12;</COLLADA>".encode()
    yield ".svg", b'<svg><path d="' + b"M0 0 L1 1 " * 500_000 + b'"/></svg>'
    yield ".xyz", b"1 2 3\n" * 3_000_000
    yield ".xyz", b"1 " * 6_000_000
    yield ".off", b"OFF " + b"9" * 5000
    yield ".off", b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n" + b"999999999 0 1 2\n"
    yield ".obj", b"f " + b"1 " * 2_000_000
    odd = b"f 1/1/1 2//2 3\n" * 9 + b"vt\nvn\ng\no\nusemtl\nl 1 2\ncurv 1"
    yield ".obj", b"v 0 0 0\n" * 300 + odd
    yield ".stl", b"solid\n" + b"vertex 1e400 nan 0\n" * 300
    elements = b"element a 1\nproperty float b\n" * 30_000
    yield ".ply", b"ply\nformat ascii 1.0\n" + elements + b"end_header\n"
    listed = b"element vertex 3\nproperty list uint uint x\nend_header\n" + b"\xff" * 90
    yield ".ply", b"ply\nformat binary_big_endian 1.0\n" + listed
    for value in (np.nan, np.inf, 1e300, -1e300, 1e-300, 1e150, 0.0):
        for suffix in SHIPPED_SUFFIXES:
            vertices = whole[0].copy()
            vertices[:: int(rng.choice([1, 7]))] = value
            yield suffix, written(vertices, whole[1], suffix)
    while True:
        suffix = str(rng.choice(SHIPPED_SUFFIXES))
        vertices, faces = whole[0].copy(), whole[1].copy()
        kind = rng.integers(5)
        if kind == 0:
            faces = faces[rng.random(len(faces)) < rng.random()]
        elif kind == 1:
            vertices *= 10.0 ** rng.uniform(-12, 12, 3)
        elif kind == 2:
            rng.shuffle(vertices)
        elif kind == 3:
            faces[rng.integers(len(faces), size=3)] = rng.integers(-3, 2 * len(vertices), (3, 3))
        last = len(vertices) - 1 if suffix == ".stl" else None
        content = written(vertices, np.clip(faces, 0, last), suffix)
        yield suffix, mutated(rng, content) if kind == 4 or rng.random() < 0.2 else content


def texts(rng, whole, write):
    """Texts of plain values: `whole` spoiled, its text with bytes changed, or one of `YAMLS`."""
    yield write(whole)
    while True:
        kind = rng.random()
        if kind < 0.6:
            yield write(spoiled(rng, whole, float(rng.uniform(0.02, 0.2))))
        elif kind < 0.8:
            yield mutated(rng, write(whole).encode()).decode("latin-1")
        else:
            yield YAMLS[int(rng.integers(len(YAMLS)))](rng)
