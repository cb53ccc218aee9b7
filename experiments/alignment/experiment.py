# SPDX-License-Identifier: Apache-2.0
"""Time alignment by local optimisation beside dynamic time warping (Maeda et al. 2014, III-E).

Two kinds of data: movements whose timing is known, and the shipped toolbox recordings, for which
only the smoothness of the warps and their effect on the trajectories can be measured.
"""

from collections.abc import Mapping

import numpy as np

from experiments.alignment.figures import recordings_figure, warp_figure
from experiments.alignment.study import (
    DTW,
    DTW_TUNED,
    LOCAL,
    METHODS,
    NOISE,
    PENALTY,
    PHASE,
    SHIFT_STD,
    TRUE,
    Method,
    MethodScore,
    Recordings,
    known_timing,
    movements,
    on_recordings,
    scaled_by_range,
    toolbox,
    velocities,
)
from experiments.alignment.time_warping import Steps, dtw_available, warped
from experiments.results import ExperimentResult, Finding
from experiments.settings import Settings
from intent_recognition.array_types import Floats
from intent_recognition.demonstrations import load_dofs
from intent_recognition.report import Block, Figure, readable, to_svg


def run(settings: Settings) -> ExperimentResult:
    """Align movements of known timing and the toolbox recordings by all installed methods."""
    there = dtw_available()
    methods = METHODS if there else {LOCAL: METHODS[LOCAL]}
    n_sets = 2 if settings.quick else 20
    known: dict[str, list[MethodScore]] = {}
    for number in range(n_sets):
        settings.progress(0.8 * number / n_sets, "movements of known timing")
        for method, result in known_timing(settings, number, methods).items():
            known.setdefault(method, []).append(result)
    settings.progress(0.8, "toolbox recordings")
    tasks = toolbox(settings)
    recorded = {task: on_recordings(*values, methods) for task, values in tasks.items()}
    typical = {method: _typical(results) for method, results in known.items()}
    return ExperimentResult(
        title="Time alignment",
        source="Maeda et al. 2014, Sec. III-E",
        question=(
            "Does local optimisation of a smooth warp align demonstrations without the jumps of"
            " dynamic time warping, and what do the jumps do to the trajectories?"
        ),
        findings=findings(typical, recorded),
        blocks=blocks(settings, tasks, methods),
        conditions=conditions(there),
        numbers={
            "known_timing": {method: _flat(result) for method, result in typical.items()},
            "toolbox": {
                task: {method: _flat(result) for method, result in results.items()}
                for task, results in recorded.items()
            },
        },
    )


def _typical(results: list[MethodScore]) -> MethodScore:
    """Median over data sets, but the largest of `largest` and `longest_flat`."""
    walks = [result.steps for result in results]
    worst = Steps(
        max(w.largest for w in walks),
        float(np.median([w.flat for w in walks])),
        max(w.longest_flat for w in walks),
        float(np.median([w.change for w in walks])),
    )
    return MethodScore(worst, *np.median([result[1:] for result in results], axis=0).tolist())


def _flat(result: MethodScore | Recordings) -> dict[str, float]:
    """All numbers of a result by name."""
    return {**result.steps._asdict(), **dict(zip(result._fields[1:], result[1:], strict=True))}


def findings(
    known: Mapping[str, MethodScore], recorded: Mapping[str, Mapping[str, Recordings]]
) -> tuple[Finding, ...]:
    """The paper's figures and ours, side by side."""
    if DTW not in known:
        remark = "dtaidistance is not installed, so there is nothing to compare with."
        largest = f"{known[LOCAL].steps.largest:.1f}"
        return (Finding.alone("longest step of a warp [mean steps]", largest, remark),)
    three, tasks = (LOCAL, DTW, DTW_TUNED), list(recorded.values())
    scores = [known[method] for method in three]

    def beside(quantity: str, paper: str, best: float, *others: float, digits: int = 1) -> Finding:
        better = best < min(others)
        text = f"{best:.{digits}f}; DTW " + ", ".join(f"{x:.{digits}f}" for x in others)
        remark = "" if better else "DTW does as well here."
        return Finding(quantity, paper, text, bool(better), remark)

    left_out = [100 * max(t[m].left_out for t in tasks) for m in three]
    return (
        beside(
            "longest step of any warp, known timing (DTW as it is, DTW tuned) [mean steps]",
            "no jumps; DTW jumps",
            *(one.steps.largest for one in scores),
        ),
        beside(
            "steps that stand still [%]",
            "smooth; DTW is not",
            *(100 * one.steps.flat for one in scores),
        ),
        beside(
            "error of the warped movement's velocity [% of its root mean square]",
            "shape is preserved; DTW's is unrealistic",
            *(100 * one.velocity for one in scores),
            digits=0,
        ),
        beside(
            "median error of the timing [thousandths of the movement]",
            "",
            *(1e3 * one.median for one in scores),
        ),
        beside(
            "toolbox: longest step of any warp [mean steps]",
            "no jumps; DTW jumps",
            *(max(t[m].steps.largest for t in tasks) for m in three),
        ),
        beside(
            "toolbox: largest speed of a warped wrist [times that recorded]",
            "",
            *(max(t[m].speed for t in tasks) for m in three),
        ),
        Finding.alone(
            "toolbox: part of a recording that a warp leaves out at the ends [%]",
            f"{left_out[0]:.0f}; DTW {left_out[1]:.0f}, {left_out[2]:.0f}",
            "A warp with free ends reads a recording that is slower than the reference only in"
            " part; DTW must match all of both, and loses it where its ends are free too.",
        ),
    )


def blocks(
    settings: Settings, tasks: Mapping[str, tuple[Floats, int]], methods: Mapping[str, Method]
) -> tuple[Block, ...]:
    """One demonstration and one task's recordings, aligned by each method."""
    clean, noisy, truth = movements(settings, 0)
    shown = [name for name in (LOCAL, DTW, DTW_TUNED) if name in methods]
    maps = {TRUE: truth} | {name: methods[name](noisy, 0) for name in shown}
    offset = np.abs(truth - PHASE).mean(axis=1)
    one = int(np.argsort(offset)[3 * len(offset) // 4])
    figure = warp_figure(
        PHASE,
        {name: found[one] - truth[one] for name, found in maps.items()},
        {name: velocities(clean, found)[one, :, 0] for name, found in maps.items()},
    )
    task, (values, reference) = next(iter(tasks.items()))
    moving = int(np.argmax(np.ptp(values[..., 3:], axis=(0, 1))))
    joint = load_dofs().controlled_names[moving]
    panels = {"as recorded": values[..., 3 + moving]}
    for name in shown:
        found = methods[name](scaled_by_range(values), reference)
        panels[name] = warped(values, found)[..., 3 + moving]
    return (
        Figure(
            to_svg(figure),
            "One demonstration of known timing. Left: recorded phase found, less the true one."
            " Right: velocity of one DOF of the noiseless movement, read along each warp.",
        ),
        Figure(
            to_svg(recordings_figure(PHASE, panels, f"{readable(joint)} [rad]")),
            f"The {readable(task)} recordings, the joint that moves farthest; mean and"
            " \N{PLUS-MINUS SIGN} 2 standard deviations.",
        ),
    )


def conditions(there: bool) -> tuple[str, ...]:
    """What differs from the paper, one sentence each."""
    same = (
        "The logarithm of the warp's slope is a basis model here, so that it cannot run backward;"
        " a coarse search picks the start of the descent, and a prior keeps noise from becoming"
        " timing.",
        f"Known timing: smooth random movements of three DOFs, noise of {100 * NOISE:g} % of"
        f" their range, both ends of the recording {100 * SHIFT_STD:g} % early or late; the paper"
        " shows no data on alignment.",
    )
    tuned = (
        "DTW is that of dtaidistance. Tuned, it may leave out up to 10 % at both ends, and a"
        f" penalty of {PENALTY:g} on steps that are not diagonal stands in for the slope"
        " constraint.",
    )
    return same + tuned if there else same
