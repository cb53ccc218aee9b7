# SPDX-License-Identifier: Apache-2.0
"""The README's moving picture, from a recording the library never saw.

`python docs/images/moving.py`: the recorded arm and wrist, what the estimator predicts of both at
every moment with tubes of two standard deviations, and the probability of each task.
"""

import argparse
from io import BytesIO
from pathlib import Path
from typing import NamedTuple

import matplotlib
import numpy as np
from matplotlib import pyplot as plt
from PIL import Image
from scene import HEIGHT, LEFT, WIDTH, Camera, learned

from intent_recognition.bags import BagReader
from intent_recognition.demonstrations import iter_observations, load_dofs, read_demonstrations
from intent_recognition.gaussian import tube_rings
from intent_recognition.kinematics import hand_position
from intent_recognition.promp import NONE, TaskLibrary
from intent_recognition.recognition import DecisionSettings, DecisionState, IntentEstimator, decide
from intent_recognition.report import INK, readable, task_colours
from intent_recognition.share import share_path
from sim_bridge.arm import SimulatedArm
from sim_bridge.scenarios.toolbox import ToolboxObjects, teaching_times

FRAMES_PER_S = 12
BEFORE_S, AFTER_S, HOLD_FRAMES = 0.25, 0.9, 14
SIZE_IN, DPI, N_COLOURS = (9.2, 3.9), 84, 96


class Moment(NamedTuple):
    """One frame: what was seen until then, and what was thought."""

    stamp_ns: int
    probabilities: np.ndarray
    active: str
    wrist_m: np.ndarray
    human: tuple[np.ndarray, np.ndarray] | None
    hand_m: np.ndarray | None


def moments(library: TaskLibrary, bag: Path, stamps_ns: np.ndarray) -> list[Moment]:
    """Run the online estimator over a recording; keep what it knew at these stamps."""
    estimator, state, dofs = IntentEstimator(library), DecisionState(), load_dofs()
    labels, settings = (*library.labels, NONE), DecisionSettings()
    found, wrist, due = [], [], list(stamps_ns)
    for observation in iter_observations(BagReader(bag), dofs):
        estimate = estimator.update(observation)
        wrist.append(observation.values)
        robot = estimator.predict_controlled() if estimate.moving else None
        end_std = estimator.predicted_end_std()
        state, active = decide(
            settings, state, labels, estimate.probabilities, end_std, estimate.log_evidence
        )
        if not due or observation.stamp_ns < due[0]:
            continue
        due.pop(0)
        human = estimator.predict_observed() if robot is not None else None
        found.append(
            Moment(
                observation.stamp_ns,
                estimate.probabilities,
                active,
                np.array(wrist),
                None if human is None else (human.trajectory.positions, human.trajectory.std),
                None if robot is None else hand_position(robot.trajectory.positions),
            )
        )
    return found


class Film:
    """Draws frames of one recording."""

    def __init__(self, library: TaskLibrary, recorded, onset_ns: int):
        self._labels = (*library.labels, NONE)
        self._colours = task_colours(self._labels)
        self._joints, self._task = recorded.controlled[0], recorded.task
        self._onset_ns = onset_ns
        arrival_s = (int(recorded.metadata["robot_arrival_ns"]) - onset_ns) * 1e-9
        self._grasp_ns = onset_ns + teaching_times(recorded.task, 0.0, arrival_s).grasp_s * 1e9
        self._camera = Camera()

    def frame(self, moment: Moment) -> Image.Image:
        """One frame."""
        figure = plt.figure(figsize=SIZE_IN, facecolor="white")
        self._draw_scene(figure.add_axes((0.0, 0.0, 0.66, 1.0)), moment)
        self._draw_bars(figure.add_axes((0.80, 0.30, 0.17, 0.44)), moment)
        stream = BytesIO()
        figure.savefig(stream, format="png", dpi=DPI)
        plt.close(figure)
        return Image.open(stream).convert("RGB")

    def _draw_scene(self, axes, moment: Moment) -> None:
        axes.imshow(self._render(moment), zorder=1)
        best = self._labels[int(np.argmax(moment.probabilities))]
        colour = self._colours[best]
        if moment.human is not None:
            self._draw_tube(axes, *moment.human, colour)
            self._line(axes, moment.hand_m, colour, ls=(0, (2, 1.2)), lw=2.2)
        recent = moment.wrist_m[-120:]
        self._line(axes, recent, INK, lw=2.4)
        at = self._camera.pixels(recent[-1:])[0]
        axes.plot(*at, "o", ms=8, color=INK, mec="white", mew=1.5, zorder=6)
        axes.set(xlim=(LEFT, WIDTH), ylim=(HEIGHT, 0))
        axes.axis("off")

    def _render(self, moment: Moment) -> np.ndarray:
        """The cell at this moment, (HEIGHT, WIDTH, 3)."""
        k = np.searchsorted(self._joints.stamps_ns, moment.stamp_ns)
        with SimulatedArm(self._joints.values[min(k, len(self._joints.values) - 1)]) as arm:
            objects = ToolboxObjects(arm, furniture=True)
            objects.move_worker(moment.wrist_m[-1])
            if moment.stamp_ns >= self._grasp_ns:
                objects.give_to_robot(self._task)
            return self._camera.render(arm.client)

    def _draw_tube(self, axes, path: np.ndarray, std: np.ndarray, colour: str) -> None:
        for ring in tube_rings(path, std, n_sides=24):
            axes.fill(*self._camera.pixels(ring).T, color=colour, alpha=0.07, lw=0, zorder=3)
        self._line(axes, path, colour, ls=(0, (2, 1.2)), lw=2.2)

    def _line(self, axes, path: np.ndarray, colour: str, **style) -> None:
        axes.plot(*self._camera.pixels(path).T, color=colour, zorder=5, **style)

    def _draw_bars(self, axes, moment: Moment) -> None:
        labels = self._labels[::-1]
        values = 100 * moment.probabilities[::-1]
        axes.barh(range(len(labels)), values, color=[self._colours[n] for n in labels])
        axes.set(xlim=(0, 100), xticks=[0, 50, 100])
        axes.set_yticks(range(len(labels)), [readable(n) for n in labels])
        axes.set_xlabel("probability [%]")
        axes.tick_params(length=0)
        axes.spines[["top", "right", "left"]].set_visible(False)
        elapsed = max((moment.stamp_ns - self._onset_ns) * 1e-9, 0.0)
        axes.set_title(f"{elapsed:.1f} s", loc="left", fontsize=13, pad=26)
        helps = f"robot: {readable(moment.active)}" if moment.active else "robot: waits"
        tint = self._colours.get(moment.active, "#5a6777")
        axes.text(0.0, 1.06, helps, transform=axes.transAxes, color=tint, fontsize=11)


def main() -> None:
    """Make the moving picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bag", default="bags/toolbox/test/plate_handover_02")
    parser.add_argument("--output", type=Path, default=Path(__file__).with_name("moving.gif"))
    args = parser.parse_args()
    matplotlib.rcParams.update({"font.family": "DejaVu Sans", "font.size": 10})
    bag, library = share_path(args.bag), learned()
    (recorded,), _ = read_demonstrations(bag, load_dofs())
    onset, end = (int(recorded.metadata[key]) for key in ("human_onset_ns", "human_end_ns"))
    first, last = onset - BEFORE_S * 1e9, end + AFTER_S * 1e9
    stamps = np.arange(first, last, 1e9 / FRAMES_PER_S)
    film = Film(library, recorded, onset)
    frames = [film.frame(moment) for moment in moments(library, bag, stamps)]
    palette = frames[len(frames) // 2].quantize(N_COLOURS)
    indexed = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    indexed += [indexed[-1]] * HOLD_FRAMES
    duration_ms = round(1000 / FRAMES_PER_S)
    indexed[0].save(
        args.output,
        save_all=True,
        append_images=indexed[1:],
        duration=duration_ms,
        loop=0,
        optimize=True,
    )
    print(f"{len(indexed)} frames, {args.output.stat().st_size / 1e6:.1f} MB")


if __name__ == "__main__":
    main()
