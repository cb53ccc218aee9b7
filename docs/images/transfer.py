# SPDX-License-Identifier: Apache-2.0
"""The picture of docs/transfer.md: `python docs/images/transfer.py` draws three trials.

Above: what the person really does to the object, and the load that the robot feels. Below: the
force of its fingers. Shaded: the person has taken over part of the load.
"""

import argparse
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from benchmarks.transfer_trials import TransferTrial, run_trial
from intent_recognition.report import DASHED, INK, PALETTE, SOFT, new_figure, styled, to_png
from intent_recognition.transfer import Holding

TRIALS = (
    ("a person takes 0.8 kg", TransferTrial("give", "bottle", "lwr", 4)),
    ("a tug of 0.1 s gets nothing", TransferTrial("tug", "bottle", "lwr", 15)),
    ("the robot takes 0.4 kg", TransferTrial("take", "plate", "lwr", 9)),
)
N_COLOURS = 64
SHOWN = {
    "give": (Holding.RELEASING, 1.3, 0.5),
    "tug": (Holding.OFFERING, 0.0, 1.5),
    "take": (Holding.CARRYING, 1.3, 0.5),
}
"""When a panel begins and ends: around the begin of a state, seconds before and after it."""
STATES = {
    Holding.CLOSING: "closes",
    Holding.TAKING: "both",
    Holding.CARRYING: "carries",
    Holding.OFFERING: "offers",
    Holding.RELEASING: "lets go",
}


def draw_trial(force: Any, grip: Any, title: str, trial: TransferTrial) -> None:
    """Draw one column."""
    samples = run_trial(trial).samples
    state, before_s, after_s = SHOWN[trial.kind]
    zero_s = next(s.time_s for s in samples if s.output.holding is state)
    samples = [s for s in samples if -before_s <= s.time_s - zero_s <= after_s]
    times = np.array([s.time_s - zero_s for s in samples])
    load = np.array([-s.force_n[2] for s in samples])
    ahead = np.array([s.force_n[0] for s in samples])
    person = np.array([s.person_n for s in samples])
    force.set_title(title)
    force.plot(times, load, color=PALETTE[0], label="load that the robot feels")
    force.plot(times, ahead, color=PALETTE[1], label="pull that it feels")
    force.plot(times, person[:, 2], color=INK, linestyle=DASHED, label="person lifts, in truth")
    grip.plot(times, [s.output.grip_n for s in samples], color=PALETTE[2], label="grip")
    offered = (s.output.share * (s.output.holding is Holding.OFFERING) for s in samples)
    share = np.fromiter(offered, float)
    grip.fill_between(times, 0.0, 25.0 * share, color=SOFT, alpha=0.2, label="share (25: all)")
    begun = None
    for time_s, sample in zip(times, samples, strict=True):
        if sample.output.holding is not begun and sample.output.holding in STATES:
            begun = sample.output.holding
            for axes in (force, grip):
                axes.axvline(time_s, color=SOFT, linewidth=0.8)
            at = (time_s, 0.98 - 0.1 * (begun is Holding.TAKING))  # beside "closes"
            frame = force.get_xaxis_transform()
            force.text(*at, f" {STATES[begun]}", transform=frame, va="top", color=SOFT, size=8)
    grip.set_xlabel("time [s]")


@styled
def draw() -> Any:
    """The figure."""
    figure = new_figure(9.6, 4.6)
    panels = figure.subplots(2, len(TRIALS), sharey="row", sharex="col")
    for column, (title, trial) in enumerate(TRIALS):
        draw_trial(panels[0, column], panels[1, column], title, trial)
    panels[0, 0].set_ylabel("force [N]")
    panels[1, 0].set_ylabel("force of a finger [N]")
    handles = [one for axes in panels[:, 0] for one in axes.get_legend_handles_labels()[0]]
    figure.legend(handles=handles, loc="outside lower center", ncols=5, frameon=False)
    return figure


def main() -> None:
    """Take the picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=Path(__file__).with_suffix(".png"))
    picture = Image.open(BytesIO(to_png(draw(), 100.0))).convert("RGB")
    picture.quantize(N_COLOURS).save(parser.parse_args().output, optimize=True)


if __name__ == "__main__":
    main()
