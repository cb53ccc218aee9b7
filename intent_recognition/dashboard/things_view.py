# SPDX-License-Identifier: Apache-2.0
"""Furniture and bodies of a cell in the scene."""

from collections.abc import Mapping, Sequence

import numpy as np
import viser
from scipy.spatial.transform import Rotation

from intent_recognition.array_types import Floats
from intent_recognition.dashboard.handling import Handling, HandlingMoment
from intent_recognition.dashboard.scene_file import GREY, CellScene, ScenePart, Thing
from intent_recognition.report import NONE_COLOUR

Colour = tuple[int, int, int]
Shape = viser.BoxHandle | viser.IcosphereHandle | viser.CylinderHandle


class ThingsView:
    """Furniture, which never moves, and bodies, which follow `Handling`."""

    def __init__(self, server: viser.ViserServer, scene: CellScene):
        self.handling = Handling(scene.bodies)
        for thing in scene.furniture:
            add_thing(server, "furniture", thing, rgb(GREY))
        grey = rgb(NONE_COLOUR)
        self._drawn: dict[str, Floats] = {}
        self._shown = [(body, *add_thing(server, "bodies", body, grey)) for body in scene.bodies]

    def update(self, moment: HandlingMoment, colours: Mapping[str, str]) -> None:
        """Move the bodies to their present poses, in the colours of their tasks."""
        self.handling.update(moment)
        for body, frame, parts in self._shown:
            pose = self.handling.pose(body.name)
            if pose is not self._drawn.get(body.name):  # the same while the body rests
                self._drawn[body.name] = pose
                frame.position, frame.wxyz = pose[:3, 3], quaternions(pose[:3, :3])
            for handle, part in zip(parts, body.parts, strict=True):
                if not part.colour:
                    handle.color = rgb(colours.get(body.task, NONE_COLOUR))


def add_thing(
    server: viser.ViserServer, kind: str, thing: Thing, colour: Colour
) -> tuple[viser.FrameHandle, Sequence[Shape]]:
    """Draw a thing as `/<kind>/<name>`; returns its frame and its parts."""
    name = f"/{kind}/{thing.name}"
    frame = server.scene.add_frame(
        name, show_axes=False, wxyz=quaternions(thing.pose[:3, :3]), position=thing.pose[:3, 3]
    )
    parts = [
        _add_part(server.scene, f"{name}/{k}", part, rgb(part.colour) if part.colour else colour)
        for k, part in enumerate(thing.parts)
    ]
    return frame, parts


def _add_part(scene: viser.SceneApi, name: str, part: ScenePart, colour: Colour) -> Shape:
    wxyz, position = quaternions(part.pose[:3, :3]), part.pose[:3, 3]
    if part.box is not None:
        return scene.add_box(name, colour, part.box, wxyz=wxyz, position=position)
    if part.sphere is not None:
        return scene.add_icosphere(name, part.sphere, colour, wxyz=wxyz, position=position)
    assert part.cylinder is not None
    return scene.add_cylinder(name, *part.cylinder, colour, wxyz=wxyz, position=position)


def quaternions(rotations: Floats) -> Floats:
    """Quaternions wxyz (..., 4) of rotation matrices (..., 3, 3)."""
    return np.roll(Rotation.from_matrix(rotations).as_quat(), 1, axis=-1)


def rgb(colour: str) -> Colour:
    """Red, green and blue from #rrggbb."""
    red, green, blue = bytes.fromhex(colour.removeprefix("#"))
    return red, green, blue
