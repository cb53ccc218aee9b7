# SPDX-License-Identifier: Apache-2.0
"""Draws the tutorials' pictures: `python docs/images/tutorials.py --model hand.npz`.

The model is one of a hand: `intent train bags/toolbox/train --dofs config/dofs_hand.yaml`.

`--practice FOLDER` (of `intent improve`) adds the picture of its costs.
"""

import argparse
import json
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import intent_recognition as ir
from intent_recognition.plots import draw_bands, name_lines, new_panels
from intent_recognition.promp import rollout

HERE = Path(__file__).resolve().parent
TASK, HEIGHT = "plate_handover", 2
DPI = 120


def draw_path(library: ir.TaskLibrary, phase: float, offset_m: float) -> Figure:
    """The height of the hand as learned, and conditioned on another place at one phase."""
    primitive = library.primitive(library.labels.index(TASK))
    dof, n_basis = library.n_observed + HEIGHT, library.basis.n_basis
    grid = np.linspace(0.0, 1.0, 101)
    figure, axes = new_panels()

    def draw(shown: ir.InteractionProMP, label: str) -> None:
        noise = shown.noise_variance
        course = rollout(shown.basis, shown.weights, grid, shown.duration_s, noise)
        draw_bands(
            axes[0, 0], course.times_s, course.positions[:, [dof]], course.std[:, [dof]], [label]
        )

    draw(primitive, "as learned")
    time_s = phase * primitive.duration_s
    wanted = (
        primitive.basis.design_matrix([phase])[0]
        @ primitive.weights.mean[dof * n_basis : (dof + 1) * n_basis]
        + offset_m
    )
    draw(ir.via_point(primitive, time_s, [wanted], dofs=[dof]), "through the point")
    axes[0, 0].plot(time_s, wanted, "ko")
    name_lines(axes[0, 0])
    axes[0, 0].set_ylabel("height of the robot's hand [m]")
    return figure


def draw_practice(folder: Path) -> Figure:
    """The cost of each rollout, and the cheapest so far."""
    rollouts = json.loads((folder / "practice.json").read_text(encoding="utf-8"))["tried"]
    costs = [one["cost"] for one in rollouts]
    figure, axes = new_panels()
    axes[0, 0].plot(costs, "o", label="rollout")
    axes[0, 0].plot([min(costs[: k + 1]) for k in range(len(costs))], label="cheapest so far")
    axes[0, 0].set(xlabel="rollout", ylabel="cost")
    axes[0, 0].legend()
    return figure


def main() -> None:
    """Draw what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--model", type=Path, metavar="M.npz")
    parser.add_argument("--practice", type=Path, metavar="FOLDER")
    args = parser.parse_args()
    figures = {}
    if args.model:
        library = ir.load_model(args.model).library
        figures["task"] = library.plot()
        figures["via"] = draw_path(library, 0.7, 0.1)
        figures["correct"] = draw_path(library, 1.0, 0.08)
    if args.practice:
        figures["practice"] = draw_practice(args.practice)
    for name, figure in figures.items():
        figure.savefig(HERE / f"{name}.png", dpi=DPI)


if __name__ == "__main__":
    main()
