# SPDX-License-Identifier: Apache-2.0
"""The README's picture, from a recording the library never saw: `python docs/images/scene.py`.

Left: PyBullet's arm where it is when the task is decided, as a ghost where it is predicted to be at
the end; the worker's wrist so far and the predicted rest, with a tube of two standard deviations.
Right: the probabilities up to then and after.
"""

import argparse
from pathlib import Path
from typing import NamedTuple

import matplotlib
import numpy as np
import pybullet
from matplotlib import pyplot as plt

from experiments.teaching.objects import ToolboxObjects
from intent_recognition.bags import BagReader
from intent_recognition.demonstrations import iter_observations, load_dofs, read_demonstrations
from intent_recognition.filtering import MovementFilter, make_prior_grid
from intent_recognition.kinematics import hand_position
from intent_recognition.learning import learn
from intent_recognition.promp import NONE, TaskLibrary, controlled_weights
from intent_recognition.recognition import DecisionSettings, DecisionState, IntentEstimator, decide
from intent_recognition.report import task_colours
from intent_recognition.share import share_path
from sim_bridge.arm import SimulatedArm
from sim_bridge.scenarios.toolbox import STANDS_M

WIDTH, HEIGHT, DPI = 1600, 1100, 100
LEFT = 170  # columns of the picture left away
N_POINTS, N_SAMPLES = 25, 600
SUPERSAMPLING = 2
HUMAN, ROBOT, TRUTH = "#c2410c", "#1d4ed8", "#292524"
EYE, TARGET = (1.0, -1.75, 1.0), (0.47, 0.02, 0.35)
FOV_DEG = 34.0


class Moment(NamedTuple):
    """What the estimator knew when the task was decided, and what happened.

    `human_m` (n, T, 3) and `robot_rad` (n, T, 7) are samples of the rest of both movements.
    """

    task: str
    decided_s: float
    times_s: np.ndarray
    probabilities: np.ndarray
    wrist_m: np.ndarray
    human_m: np.ndarray
    robot_rad: np.ndarray
    q_now: np.ndarray
    true_wrist_m: np.ndarray
    end_s: float


def watch(library: TaskLibrary, bag: Path) -> Moment:
    """Run the online estimator over a recording and keep the moment of the decision."""
    dofs = load_dofs()
    (recorded,), _ = read_demonstrations(bag, dofs)
    estimator, state = IntentEstimator(library), DecisionState()
    labels, settings = (*library.labels, NONE), DecisionSettings()
    observations, estimates, decided = [], [], None
    for observation in iter_observations(BagReader(bag), dofs):
        estimate = estimator.update(observation)
        observations.append(observation)
        if not estimate.moving:
            continue
        estimates.append(estimate)
        end_std = estimator.predicted_end_std()
        state, active = decide(
            settings, state, labels, estimate.probabilities, end_std, estimate.log_evidence
        )
        if active and decided is None:
            decided = (active, len(observations), estimate)
    task, count, estimate = decided
    onset_ns, end_ns = estimate.onset_ns, int(recorded.metadata["human_end_ns"])
    seen = [o for o in observations[:count] if o.stamp_ns >= onset_ns]
    human, robot = rest_of_both(library, task, seen, estimate)
    joints, poses = recorded.controlled[0], recorded.observed[0]
    ahead = (poses.stamps_ns >= estimate.stamp_ns) & (poses.stamps_ns <= end_ns)
    return Moment(
        task,
        (estimate.stamp_ns - onset_ns) * 1e-9,
        np.array([(e.stamp_ns - onset_ns) * 1e-9 for e in estimates]),
        np.array([e.probabilities for e in estimates]),
        np.array([o.values for o in seen]),
        human,
        robot,
        joints.values[np.searchsorted(joints.stamps_ns, estimate.stamp_ns)],
        poses.values[ahead],
        (end_ns - onset_ns) * 1e-9,
    )


def rest_of_both(library: TaskLibrary, task: str, seen, estimate) -> tuple[np.ndarray, np.ndarray]:
    """Sampled rest of the human's movement (n, T, 3) and of the robot's (n, T, 7)."""
    index, rng = library.labels.index(task), np.random.default_rng(1)
    run = MovementFilter(library, make_prior_grid(library), estimate.onset_ns)
    for observation in seen:
        run.observe(observation)
    basis, observed = library.basis, run.prediction(index).observed_weights()
    controlled = controlled_weights(library, index, observed)
    design = basis.design_matrix(np.linspace(estimate.phase[index], 1.0, N_POINTS))
    paths = []
    for weights in (observed, controlled):
        samples = rng.multivariate_normal(weights.mean, weights.covariance, N_SAMPLES)
        per_dof = samples.reshape(N_SAMPLES, -1, basis.n_basis)
        paths.append(np.einsum("tk,ndk->ntd", design, per_dof))
    return paths[0], paths[1]


def learned() -> TaskLibrary:
    """The library of the shipped training bags."""
    demonstrations, _ = read_demonstrations(share_path("bags/toolbox/train"), load_dofs())
    return learn(demonstrations)


class Camera:
    """Renders the world and projects points of it into the same picture."""

    def __init__(self):
        self._view = pybullet.computeViewMatrix(EYE, TARGET, (0, 0, 1))
        self._projection = pybullet.computeProjectionMatrixFOV(FOV_DEG, WIDTH / HEIGHT, 0.1, 6.0)

    def render(self, client) -> np.ndarray:
        """The world as an image (HEIGHT, WIDTH, 3) in [0, 1]."""
        size = (WIDTH * SUPERSAMPLING, HEIGHT * SUPERSAMPLING)
        _, _, pixels, _, _ = client.getCameraImage(
            *size,
            self._view,
            self._projection,
            lightDirection=(0.6, -1.2, 2.0),
            lightAmbientCoeff=0.62,
            lightDiffuseCoeff=0.42,
            lightSpecularCoeff=0.05,
            shadow=0,
            renderer=pybullet.ER_TINY_RENDERER,
        )
        image = np.reshape(np.array(pixels, dtype=np.float64), (size[1], size[0], 4))[..., :3] / 255
        blocks = image.reshape(HEIGHT, SUPERSAMPLING, WIDTH, SUPERSAMPLING, 3)
        return blocks.mean(axis=(1, 3))

    def pixels(self, points_m: np.ndarray) -> np.ndarray:
        """Pixels (n, 2) of points (n, 3)."""
        view = np.reshape(self._view, (4, 4), order="F")
        projection = np.reshape(self._projection, (4, 4), order="F")
        homogeneous = np.c_[points_m, np.ones(len(points_m))] @ (projection @ view).T
        ndc = homogeneous[:, :2] / homogeneous[:, 3:]
        return np.c_[(ndc[:, 0] + 1) / 2 * WIDTH, (1 - ndc[:, 1]) / 2 * HEIGHT]


def fan(camera: Camera, paths_m: np.ndarray) -> np.ndarray:
    """Pixels within two standard deviations of many sampled paths (n, T, 3), (HEIGHT, WIDTH)."""
    rows, columns = np.mgrid[:HEIGHT, :WIDTH]
    mask = np.zeros((HEIGHT, WIDTH), dtype=bool)
    for k in range(paths_m.shape[1]):
        points = camera.pixels(paths_m[:, k])
        mean, precision = points.mean(axis=0), np.linalg.inv(np.cov(points.T) + np.eye(2))
        x, y = columns - mean[0], rows - mean[1]
        mask |= precision[0, 0] * x**2 + 2 * precision[0, 1] * x * y + precision[1, 1] * y**2 <= 4.0
    return mask


def shade(axes, mask: np.ndarray, colour: str) -> None:
    """A translucent area with a faint edge."""
    rgba = np.zeros((HEIGHT, WIDTH, 4))
    rgba[..., :3] = matplotlib.colors.to_rgb(colour)
    rgba[..., 3] = 0.2 * mask
    axes.imshow(rgba, zorder=3)
    axes.contour(mask, levels=[0.5], colors=[colour], linewidths=0.8, alpha=0.5, zorder=3)


def furnish(client, objects: ToolboxObjects) -> None:
    """A bench, and a post below each thing on its stand."""
    boxes = [((0.3, 0.5, 0.02), (0.75, 0.65, 0.5, 1.0), (0.75, 0.0, 0.05))]
    for task in STANDS_M:
        x, y, _ = objects.position(task)
        half = 0.5 * (client.getAABB(objects.bodies[task])[0][2] - 0.05)
        boxes.append(((0.012, 0.012, half), (0.6, 0.6, 0.6, 1.0), (x, y, 0.05 + half)))
    for half_edges, colour, place in boxes:
        shape = client.createVisualShape(client.GEOM_BOX, halfExtents=half_edges, rgbaColor=colour)
        client.createMultiBody(0.0, -1, shape, place)


def draw_scene(axes, moment: Moment) -> None:
    """The arm now, its ghost at the predicted end, and both paths."""
    camera, images = Camera(), []
    for posture, carries in ((moment.q_now, False), (moment.robot_rad.mean(axis=0)[-1], True)):
        arm = SimulatedArm(posture)
        objects = ToolboxObjects(arm)
        furnish(arm.client, objects)
        objects.move_worker(moment.wrist_m[-1])
        if carries:
            objects.give_to_robot(moment.task)
        images.append(camera.render(arm.client))
        arm.close()
    axes.imshow(np.clip(0.66 * images[0] + 0.34 * images[1], 0, 1), zorder=1)
    hands = hand_position(moment.robot_rad)
    for paths, colour in ((hands, ROBOT), (moment.human_m, HUMAN)):
        shade(axes, fan(camera, paths), colour)
        line = camera.pixels(paths.mean(axis=0))
        axes.plot(*line.T, color=colour, lw=3, ls=(0, (2, 1.2)), zorder=4)
        axes.plot(*line[-1], "o", ms=8, color=colour, zorder=5)
    axes.plot(*camera.pixels(moment.true_wrist_m).T, color=TRUTH, lw=1.8, zorder=4)
    seen = camera.pixels(moment.wrist_m)
    axes.plot(*seen.T, color=HUMAN, lw=5, solid_capstyle="round", zorder=5)
    axes.plot(*seen[-1], "o", ms=13, color=HUMAN, mec="white", mew=2, zorder=6)
    wrist, hand = moment.human_m.mean(axis=0), hands.mean(axis=0)
    label(axes, seen[0], (0, -34), "the worker's wrist\nso far", HUMAN)
    label(axes, camera.pixels(moment.true_wrist_m)[-1], (-4, -62), "where it went", TRUTH)
    label(axes, camera.pixels(wrist)[4], (26, 62), "predicted wrist, \u00b12\u03c3", HUMAN)
    label(axes, camera.pixels(hand)[-1], (-6, 112), "predicted hand, \u00b12\u03c3", ROBOT)
    axes.set(xlim=(LEFT, WIDTH), ylim=(HEIGHT, 0))
    axes.axis("off")


def label(axes, at, offset, text: str, colour: str) -> None:
    """A word about a place in the picture."""
    axes.annotate(
        text,
        at,
        xytext=offset,
        textcoords="offset points",
        color=colour,
        fontsize=11.5,
        ha="center",
        va="center",
        arrowprops={"arrowstyle": "-", "color": colour, "lw": 0.8, "shrinkB": 4},
        zorder=7,
    )


def draw_probabilities(axes, moment: Moment, labels: tuple[str, ...]) -> None:
    """Probability of every task over the movement; after the decision fainter."""
    before = moment.times_s <= moment.decided_s
    colours = task_colours(labels)
    for column, label in enumerate(labels):
        colour = colours[label]
        values = 100 * moment.probabilities[:, column]
        axes.plot(moment.times_s, values, color=colour, lw=1.8, alpha=0.3)
        axes.plot(moment.times_s[before], values[before], color=colour, lw=2.6, label=label)
    axes.axvline(moment.decided_s, color="#1c1917", lw=1)
    axes.axvline(moment.end_s, color="#a8a29e", lw=1, ls="--")
    axes.set(ylim=(-3, 107), xlim=(0, moment.end_s + 0.15), yticks=[0, 50, 100])
    axes.set_xlabel("seconds since the wrist began to move")
    axes.set_ylabel("probability [%]")
    axes.spines[["top", "right"]].set_visible(False)


def main() -> None:
    """Make the picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bag", default="bags/toolbox/test/plate_handover_02")
    parser.add_argument("--output", type=Path, default=Path(__file__).with_name("scene.png"))
    args = parser.parse_args()
    library = learned()
    moment = watch(library, share_path(args.bag))
    plt.rcParams.update({"font.family": "DejaVu Sans", "font.size": 12})
    figure = plt.figure(figsize=(12.6, 5.3), facecolor="white")
    scene = figure.add_axes((0.0, 0.0, 0.61, 1.0))
    draw_scene(scene, moment)
    plot = figure.add_axes((0.685, 0.17, 0.30, 0.60))
    draw_probabilities(plot, moment, (*library.labels, NONE))
    share = moment.decided_s / moment.end_s
    plot.annotate(
        f"decided at {share:.0%}\nof the movement",
        (moment.decided_s, 50),
        xytext=(8, -6),
        textcoords="offset points",
        fontsize=11,
    )
    plot.legend(loc="lower left", bbox_to_anchor=(-0.02, 1.02), ncols=2, frameon=False, fontsize=11)
    figure.savefig(args.output, dpi=DPI, metadata={"Software": None})
    print(f"{moment.task} decided after {moment.decided_s:.2f} s, {share:.0%} of the movement")


if __name__ == "__main__":
    main()
