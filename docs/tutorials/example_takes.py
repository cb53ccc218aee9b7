# SPDX-License-Identifier: Apache-2.0
"""Simulated takes in the form that Motive exports, with the joint log of a Panda beside them.

Two tasks: a person reaches for a bolt or a tray, and the arm, guided by hand, meets the hand.
"""

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pybullet_data
from numpy.typing import NDArray

from intent_recognition.kinematics import Arm

REST_M = np.array([1.1, 0.0, 0.27])
"""Where the wrist rests, in the frame of the arm's base [m]."""
PLACES_M = {"hand_bolt": (0.65, -0.3, 0.35), "hand_tray": (0.62, 0.28, 0.25)}
"""Where the wrist reaches, by task [m]."""
BEFORE_M = np.array([-0.09, 0.0, 0.02])
"""Where the arm's hand stops, from the wrist [m]."""
READY = (0.0, -0.3, 0.0, -2.2, 0.0, 1.9, 0.785)
"""Posture in which the arm waits [rad]."""
CAMERAS_HZ, ARM_HZ = 120.0, 100.0
"""Rates of the cameras and of the arm's log."""
HEAD = (
    "Format Version,1.23,Take Name,{name},Take Notes,,Capture Frame Rate,120.000000,Export Frame"
    " Rate,120.000000,Capture Start Time,2026-03-02 10.{minute:02}.00.000 AM,Capture Start Frame,0,"
    "Total Frames in Take,{rows},Total Exported Frames,{rows},Rotation Type,Quaternion,Length"
    " Units,Millimeters,Coordinate Space,Global"
)
MARKERS = np.array([[0.0, 0.03, 0.0], [0.03, -0.02, 0.0], [-0.03, -0.02, 0.01]])
"""Markers of the rigid body [m]."""


def takes(n: int, seed: int) -> Iterator[tuple[str, NDArray[np.float64], NDArray[np.float64]]]:
    """Name, wrist (T, 3) [m] at CAMERAS_HZ and joints (T, 7) [rad] at ARM_HZ of each take."""
    rng = np.random.default_rng(seed)
    path = Path(pybullet_data.getDataPath()) / "franka_panda/panda.urdf"
    arm = Arm.from_urdf(path, tip="panda_grasptarget", rest=READY)
    for task, place in PLACES_M.items():
        for number in range(n):
            goal = np.array(place) + rng.normal(0.0, 0.04, 3)
            moves_s, waits_s = rng.normal(1.5, 0.12), rng.uniform(0.9, 1.2)
            lasts_s = waits_s + moves_s + 0.8
            times_s = np.arange(0.0, lasts_s, 1.0 / CAMERAS_HZ)
            wrist = REST_M + _share((times_s - waits_s) / moves_s) * (goal - REST_M)
            wrist += np.array([0.0, 0.0, 0.06]) * np.sin(np.pi * _share((times_s - waits_s) / 1.5))
            times_s = np.arange(0.0, lasts_s, 1.0 / ARM_HZ)
            posture = arm.inverse_kinematics(goal + BEFORE_M, READY, READY)
            share = _share((times_s - waits_s - 0.2) / moves_s)
            joints = READY + share * (posture - READY)
            yield (
                f"{task}_{number:02}",
                wrist + rng.normal(0.0, 0.0003, wrist.shape),
                joints + rng.normal(0.0, 0.0002, joints.shape),
            )


def _share(time: NDArray[np.float64]) -> NDArray[np.float64]:
    """Share of the way of a minimum-jerk movement (T, 1)."""
    t = np.clip(time, 0.0, 1.0)
    return (t**3 * (10.0 - 15.0 * t + 6.0 * t**2))[:, None]


def motive(name: str, minute: int, wrist: NDArray[np.float64]) -> str:
    """A take as Motive exports it: a rigid body, its markers, and one that has no name."""
    bodies = [("wrist", "Rigid Body", "4B1A")] * 8
    for k in range(len(MARKERS)):
        bodies += [(f"wrist:Marker {k + 1:03}", "Rigid Body Marker", f"9C{k}0")] * 4
    bodies += [("Unlabeled 1204", "Marker", "7D20")] * 3
    kinds = ["Rotation"] * 4 + ["Position"] * 3 + ["Mean Marker Error"]
    kinds += (["Position"] * 3 + ["Marker Quality"]) * len(MARKERS) + ["Position"] * 3
    axes = [*"XYZWXYZ", ""] + [*"XYZ", ""] * len(MARKERS) + [*"XYZ"]
    lines = [HEAD.format(name=name, minute=minute, rows=len(wrist)), ""]
    for title, cells in (
        ("Type", [kind for _, kind, _ in bodies]),
        ("Name", [body for body, _, _ in bodies]),
        ("ID", [number for *_, number in bodies]),
        ("", kinds),
    ):
        lines.append(",".join(["", title, *cells]))
    lines.append(",".join(["Frame", "Time (Seconds)", *axes]))
    for frame, place in enumerate(wrist):
        numbers = ["0.000000", "0.000000", "0.000000", "1.000000"]
        numbers += [f"{1e3 * x:.6f}" for x in place] + ["0.312000"]
        for marker in place + MARKERS:
            numbers += [f"{1e3 * x:.6f}" for x in marker] + ["1.000000"]
        seen = frame % 50 < 3  # a reflection
        numbers += [f"{1e3 * x:.6f}" if seen else "" for x in place + 0.4]
        lines.append(",".join([str(frame), f"{frame / CAMERAS_HZ:.6f}", *numbers]))
    return "\n".join(lines) + "\n"


def arm_log(joints: NDArray[np.float64]) -> str:
    """The joints as a driver's log has them, in radians, from the same start as the take."""
    names = ",".join(f"panda_joint{k}" for k in range(1, 8))
    rows = (
        f"{row / ARM_HZ:.3f}," + ",".join(f"{q:.6f}" for q in posture)
        for row, posture in enumerate(joints)
    )
    return "\n".join([f"time,{names}", *rows]) + "\n"


def main() -> None:
    """Write takes into a folder."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--number", type=int, default=8, help="of takes of each task (default: 8)")
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    for folder in ("motive", "panda"):
        (args.folder / folder).mkdir(parents=True, exist_ok=True)
    for minute, (name, wrist, joints) in enumerate(takes(args.number, args.seed)):
        (args.folder / "motive" / f"{name}.csv").write_text(motive(name, minute, wrist))
        (args.folder / "panda" / f"{name}.csv").write_text(arm_log(joints))


if __name__ == "__main__":
    main()
