# SPDX-License-Identifier: Apache-2.0
"""Pouring carries over to containers never demonstrated (Brandl et al. 2014, Fig. 4 and 5).

The pours of the arm are recorded; the experiment counts what became of their balls, and lets the
arm repeat some of them in physics.
"""

from experiments.pouring.executed import MEAN, UNWARPED, execute, learn_skill, planned
from experiments.pouring.report import CONDITIONS, blocks, findings
from experiments.pouring.study import numbers_of, pair_name, read_recorded
from experiments.results import ExperimentResult
from experiments.settings import Settings
from sim_bridge.scenarios.pouring import PAIRS

REPEATED = ((2, MEAN), (6, UNWARPED))
QUICK = ((1, MEAN),)
SEED = 1
"""Seed of the recorded pours."""


def run(settings: Settings) -> ExperimentResult:
    """Learn from one pair, count what was spilled with others, repeat some pours."""
    settings.progress(0.0, "learning from the demonstrations")
    demonstrations = settings.recordings("pouring/train")
    skill = learn_skill(demonstrations, SEED)
    settings.progress(0.2, "reading the pours")
    pours = read_recorded(settings.recordings("pouring/executed"))
    repeated = []
    wanted = QUICK if settings.quick else REPEATED
    for done, (pair, manner) in enumerate(wanted):
        one = next(p for p in pours if (p.order.pair, p.order.manner) == (pair, manner))
        settings.progress(0.4 + 0.6 * done / len(wanted), f"repeating {pair_name(pair)}")
        again = execute(one.order, planned(one.order, skill))
        repeated.append((one, int(again.spilled), int(again.kept)))
    settings.progress(1.0, "figures")
    numbers = numbers_of(pours, skill, repeated)
    return ExperimentResult(
        title="Pouring with containers never demonstrated",
        source="Brandl et al. 2014, Fig. 4 and 5",
        question=(
            "Ten kinesthetic demonstrations with one cup and one bowl: does the arm pour with"
            f" {len(PAIRS)} other pairs when the primitive is rescaled by warped parameters, and"
            " what is spilled when it is not?"
        ),
        findings=findings(numbers, repeated),
        blocks=blocks(pours, skill, demonstrations, repeated),
        conditions=CONDITIONS,
        numbers=numbers,
    )
