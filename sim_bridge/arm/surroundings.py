# SPDX-License-Identifier: Apache-2.0
"""Obstacles around a simulated arm, and how often it touched them.

Boxes stand in the world. Links that a URDF fixes to its root (a table, a wall) are part of the
arm's body in PyBullet, and stop the arm as well. Positions are in the world, which is the frame of
the root link on `robot_description`.
"""

from collections.abc import Iterable, Sequence

from intent_recognition.kinematics import Box
from sim_bridge.arm.arm import SimulatedArm
from sim_bridge.arm.urdf_loading import link_name
from sim_bridge.physics import BulletClient, pybullet

APART_STEPS = 100
"""Two bodies touch anew only if they were apart for longer than this [ms]; a bounce is shorter."""


class Surroundings:
    """Puts boxes into the arm's world, and counts touches from then on.

    Attributes:
        touches: how often a link began to touch an obstacle.
        last: names of the link and the obstacle that touched last; empty before.
    """

    def __init__(self, arm: SimulatedArm, boxes: Sequence[Box]) -> None:
        self._arm, self.touches, self.last = arm, 0, ("", "")
        self._since: dict[tuple[int, int, int], int] = {}
        self._boxes = {add_box(arm.client, box): box.name for box in boxes}
        if self._boxes or arm.fixtures:
            arm.before_step.append(self._look)

    def touching(self) -> tuple[str, str] | None:
        """Names of a link and an obstacle that touch now; None if none do."""
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
        """Link, other body and the other's link of all contacts with a force."""
        for contact in arm.client.getContactPoints(bodyA=arm.body) or ():
            _, _, thing, link, other = contact[:5]
            if contact[9] <= 0.0:  # near, but nothing presses
                continue
            if thing in self._boxes:
                yield link, thing, other
            elif thing == arm.body:
                yield (link, thing, other) if other in arm.fixtures else (other, thing, link)


def add_box(client: BulletClient, box: Box) -> int:
    """Put a fixed box into a world and return its body."""
    half = [0.5 * edge for edge in box.size]
    shape = client.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half)
    looks = client.createVisualShape(
        pybullet.GEOM_BOX, halfExtents=half, rgbaColor=(0.55, 0.45, 0.35, 1.0)
    )
    return int(client.createMultiBody(0.0, shape, looks, box.center, box.quaternion))
