# SPDX-License-Identifier: Apache-2.0
"""What stands about a simulated arm, as bodies that it can hit, and how often it did.

Boxes stand in the world; what a URDF fixes to its root (a table, a wall) is part of the arm's body
in PyBullet and stops it likewise. Positions are in the world, which is the frame of the root link
on `robot_description`.
"""

from collections.abc import Iterable, Sequence

from intent_recognition.kinematics import Box
from sim_bridge.arm.arm import SimulatedArm
from sim_bridge.arm.urdf_loading import link_name
from sim_bridge.physics import BulletClient, pybullet

APART_STEPS = 100
"""Two bodies that part for less than this do not touch anew [ms]. Convention: they bounce."""


class Surroundings:
    """Puts boxes into the arm's world, and counts touches from then on.

    Attributes:
        touches: how often a link began to touch a thing.
        last: names of the two that touched last; empty before.
    """

    def __init__(self, arm: SimulatedArm, boxes: Sequence[Box]) -> None:
        self._arm, self.touches, self.last = arm, 0, ("", "")
        self._since: dict[tuple[int, int, int], int] = {}
        self._boxes = {add_box(arm.client, box): box.name for box in boxes}
        if self._boxes or arm.fixtures:
            arm.before_step.append(self._look)

    def touching(self) -> tuple[str, str] | None:
        """The two bodies that touch one another now; None for none."""
        now = self._arm.n_steps
        return self.last if any(now - at <= APART_STEPS for at in self._since.values()) else None

    def _look(self, arm: SimulatedArm) -> None:
        for link, thing, fixture in self._contacts(arm):
            key = link, thing, fixture
            if arm.n_steps - self._since.get(key, -APART_STEPS - 1) > APART_STEPS:
                self.touches += 1
                other = self._name(fixture) if thing == arm.body else self._boxes[thing]
                self.last = self._name(link), other
            self._since[key] = arm.n_steps

    def _name(self, link: int) -> str:
        return link_name(self._arm.client, self._arm.body, link)

    def _contacts(self, arm: SimulatedArm) -> Iterable[tuple[int, int, int]]:
        """Link, other body and its link, of all contacts that press on one another."""
        for contact in arm.client.getContactPoints(bodyA=arm.body) or ():
            _, _, thing, link, other = contact[:5]
            if contact[9] <= 0.0:  # near, but nothing presses
                continue
            if thing in self._boxes:
                yield link, thing, other
            elif thing == arm.body:
                yield (link, thing, other) if other in arm.fixtures else (other, thing, link)


def add_box(client: BulletClient, box: Box) -> int:
    """Put a box into a world, where it stays; returns its body."""
    half = [0.5 * edge for edge in box.size]
    shape = client.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half)
    looks = client.createVisualShape(
        pybullet.GEOM_BOX, halfExtents=half, rgbaColor=(0.55, 0.45, 0.35, 1.0)
    )
    return int(client.createMultiBody(0.0, shape, looks, box.center, box.quaternion))
