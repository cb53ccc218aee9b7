# SPDX-License-Identifier: Apache-2.0
"""One annotated grasp is carried to other containers by the warp, and tested by lifting them."""

from collections.abc import Mapping, Sequence

from experiments.grasps.figures import cuts_figure
from experiments.grasps.gripper import FORCE_N
from experiments.grasps.lifting import DENSITY_KG_M3, FRICTION, HOLD_S, LIFT_M
from experiments.grasps.study import (
    CARRIED,
    MANNERS,
    VIEWS,
    WARPED,
    Subject,
    Trial,
    investigate,
    made,
    scanned,
    share_held,
    tipped_deg,
)
from experiments.results import ExperimentResult, Finding
from experiments.settings import Settings
from intent_recognition.errors import IntentError
from intent_recognition.report import Figure, to_svg

WANTED_SHARE = 0.85
"""Share of the containers that has to be held."""
MESHES = "meshes"
"""Folder of scanned containers, below that of the recordings."""
CONDITIONS = (
    "The mug's grasp pinches the wall from above, beside the handle, one finger inside; to its"
    " width each finger adds a centimetre on its way.",
    "Nine made kinds, three sizes each, and what scanned containers there are, seen by a depth"
    " camera with noise from one, two and three sides; the mug itself is left out.",
    "Without a warp the grasp is moved rigidly from the mug's frame to the container's: same"
    " place, direction and width seen from the centre of the opening.",
    f"A hand of the Franka Hand's size presses with {FORCE_N:g} N a finger; friction"
    f" {FRICTION:g}; every container weighs as if of stoneware ({DENSITY_KG_M3:g} kg/m^3) and is"
    f" empty. It is lifted by {100.0 * LIFT_M:g} cm and held for {HOLD_S:g} s: both fingers have to"
    " touch it and the table must not.",
    "Containers collide as some 260 convex pieces of wall, floor and handle, whose margin makes a"
    " wall 1 mm thicker on both sides.",
)


def run(settings: Settings) -> ExperimentResult:
    """Lift made containers, and scanned ones if there are any."""
    draws = [(settings.seed + k, VIEWS[k : k + 1]) for k in range(len(VIEWS))]
    looks = [(one, seed, views) for seed, views in draws for one in made(seed)]
    looks += [(one, settings.seed, VIEWS) for one in _scanned(settings)]
    if settings.quick:
        looks = [(one, seed, VIEWS[1:2]) for one, seed, _ in looks[1:9:5] + looks[27:28]]
    trials, refused = investigate(looks, lambda share, what: settings.progress(0.95 * share, what))
    settings.progress(0.95, "figures")
    kinds = dict.fromkeys(t.subject.kind for t in trials)
    shares = {kind: {m: share_held(trials, m, kind) for m in MANNERS} for kind in kinds}
    last = {t.subject.name: (t.subject, t.views) for t in trials}
    drawn = [t for t in trials if last[t.subject.name] == (t.subject, t.views)]
    return ExperimentResult(
        title="Grasps warp with the objects",
        source="no paper; beside the grasp not warped",
        question=(
            "A person shows once where a hand takes the mug. Does the warp tell where it takes"
            " other cups and bowls?"
        ),
        findings=findings(trials, shares),
        blocks=(
            Figure(
                to_svg(cuts_figure(drawn)),
                "Cuts through the containers, with the fingers on their way: filled where the"
                " container was held. Lengths in millimetres.",
            ),
        ),
        conditions=CONDITIONS,
        numbers={
            "held": shares,
            "tipped_deg_median": tipped_deg(trials),
            "refused": refused,
            "trials": [
                {"name": t.subject.name, "seed": t.seed, "views": t.views, "manner": t.manner}
                | ({} if t.lifted is None else t.lifted._asdict())
                for t in trials
            ],
        },
    )


def findings(
    trials: Sequence[Trial], shares: Mapping[str, Mapping[str, float]]
) -> tuple[Finding, ...]:
    """Shares held, by kind of container, and how level they hang."""
    rows = []
    for kind, share in shares.items():
        n = sum(t.subject.kind == kind and t.manner == WARPED for t in trials)
        rows.append(
            Finding(
                f"{kind} containers held, of {n} lifts",
                f">= {100.0 * WANTED_SHARE:.0f} %; {100.0 * share[CARRIED]:.0f} % not warped",
                f"{100.0 * share[WARPED]:.0f} %",
                share[WARPED] >= WANTED_SHARE,
                f"Wanted are {100.0 * WANTED_SHARE:.0f} %; no paper has this experiment.",
            )
        )
    tipped = tipped_deg(trials)
    rows.append(
        Finding(
            "tipping in the hand where both hold [deg] (median)",
            f"{tipped[CARRIED]:.1f} not warped",
            f"{tipped[WARPED]:.1f}",
            tipped[WARPED] < tipped[CARRIED],
            "From the closed fingers to the end; containers hang beside the hand.",
        )
    )
    return tuple(rows)


def _scanned(settings: Settings) -> list[Subject]:
    try:
        return list(scanned(settings.recordings(MESHES)))
    except IntentError:
        return []
