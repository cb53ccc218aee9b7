# SPDX-License-Identifier: Apache-2.0
"""Wrap PyBullet, whose C code writes to the standard streams of the process."""

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from intent_recognition.errors import optional

STDOUT, STDERR = 1, 2


@contextmanager
def _silent(*streams: int) -> Iterator[None]:
    """Discard output to standard streams, including that of C code."""
    _flush()
    kept = {number: os.dup(number) for number in streams}
    null = os.open(os.devnull, os.O_WRONLY)
    try:
        for number in kept:
            os.dup2(null, number)
        yield
    finally:
        _flush()
        for number, stream in kept.items():
            os.dup2(stream, number)
            os.close(stream)
        os.close(null)


def _flush() -> None:
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:
            stream.flush()
    ctypes.CDLL(None).fflush(None)


with _silent(STDOUT, STDERR):
    pybullet = optional("pybullet")
    from pybullet_utils.bullet_client import BulletClient


class _World(BulletClient):
    """A client that looks up each of PyBullet's functions once instead of at every call."""

    def __getattr__(self, name: str) -> Any:
        found = super().__getattr__(name)
        if name != "disconnect":  # looking this up ends the client
            setattr(self, name, found)
        return found


def start_world(*, headless: bool = True) -> BulletClient:
    """Start an empty world, with a window unless headless.

    If no window can be opened, PyBullet writes the reason to stderr and ends the process.
    """
    with _silent(STDOUT):
        client = _World(pybullet.DIRECT if headless else pybullet.GUI)
    # PyBullet has one threshold for all worlds of a process: reset a ball world's value.
    client.setPhysicsEngineParameter(contactBreakingThreshold=0.02)  # PyBullet's default
    return client


def fix(client: BulletClient, body: int, parent: int, link: int) -> int:
    """Fix a body at its present pose to a link of another (-1 for the base), or to the world."""
    here, none = client.getBasePositionAndOrientation(body), ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    if parent < 0:  # the body first: PyBullet takes the world only as the child
        ends, own, others = (body, -1, -1, -1), none, here
    else:  # constraints are anchored at centres of mass
        at = client.getBasePositionAndOrientation(parent)
        if link >= 0:
            at = client.getLinkState(parent, link, computeForwardKinematics=1)[:2]
        own = client.multiplyTransforms(*client.invertTransform(*at), *here)
        ends, others = (parent, link, body, -1), none
    frames = own[0], others[0], own[1], others[1]
    return int(client.createConstraint(*ends, pybullet.JOINT_FIXED, (0, 0, 0), *frames))


def end_world(client: BulletClient) -> None:
    """End a world, unless it has ended."""
    if client.isConnected():
        with _silent(STDOUT):
            client.disconnect()
