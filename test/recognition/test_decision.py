# SPDX-License-Identifier: Apache-2.0
"""When a task activates, stays, switches and is let go."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from simulation import make_library

from intent_recognition.errors import ArgumentError, ShapeError
from intent_recognition.promp import LeftOutOdds, risk_of
from intent_recognition.recognition import DecisionSettings, DecisionState, decide
from intent_recognition.recognition.decision import (
    decision_settings,
    is_evident,
    learned_risk,
    possible_tasks,
    uncertain_end,
)

LABELS = ("plate", "screw", "none")
SURE = {"plate": (0.95, 0.04, 0.01), "screw": (0.02, 0.97, 0.01), "none": (0.03, 0.02, 0.95)}
IDLE = (0.0, 0.0, 1.0)
UNCLEAR = (0.4, 0.35, 0.25)
SETTINGS = DecisionSettings()


def in_rad(std: float | None) -> dict[str, float] | None:
    return None if std is None else {"rad": std}


def play(steps, settings=SETTINGS, state=DecisionState(), end_std=0.1):  # noqa: B008
    active = []
    events = []
    for p in steps:
        state, now = decide(settings, state, LABELS, np.array(p), in_rad(end_std))
        active.append(now)
        events.append(state.event)
    return state, active, [event for event in events if event]


PLATE = [SURE["plate"]] * 5


@pytest.mark.parametrize(
    ("steps", "before", "now", "events"),
    [
        (PLATE, "", "plate", ["activated"]),
        (PLATE[:4] + [UNCLEAR] + PLATE[:4], "", "", []),
        (PLATE[:4] + [SURE["screw"]] * 4, "", "", []),
        (PLATE + [SURE["screw"]] * 5, "plate", "screw", ["activated", "switched"]),
        (PLATE + [SURE["none"]] * 5, "plate", "", ["activated", "withdrawn"]),
        # near the goal several tasks are as probable: none of them is more probable than not
        (PLATE + [UNCLEAR] * 20, "plate", "plate", ["activated"]),
        (PLATE + [(0.46, 0.44, 0.10)] * 20, "plate", "plate", ["activated"]),
        (PLATE + [(0.3, 0.4, 0.3)] * 20, "plate", "plate", ["activated"]),
        # likely, but not certain to be idle
        (PLATE + [(1e-6, 0.0, 1.0 - 1e-6)], "plate", "plate", ["activated"]),
    ],
)
def test_what_is_active_after_these_observations(steps, before, now, events):
    _, active, found = play(steps)
    assert (active[-2:], found) == ([before, now], events)


@pytest.mark.parametrize("end_std", [0.5, None])
def test_an_uncertain_or_unknown_end_holds_it_back(end_std):
    state, active, _ = play([SURE["plate"]] * 9, end_std=end_std)
    assert set(active) == {""} and play(PLATE[:1], state=state)[1] == ["plate"]
    loose = DecisionSettings(max_end_std_rad=np.inf, max_end_std_m=np.inf)
    assert play([SURE["plate"]] * 5, loose, end_std=end_std)[1][-1] == "plate"


def test_why_it_is_held_back_is_said_once_everything_else_holds():
    state, _, _ = play([SURE["plate"]] * 4, end_std=0.52)
    assert uncertain_end(SETTINGS, state, {"rad": 0.52}) == ""
    state, _, _ = play([SURE["plate"]] * 5, end_std=0.52)
    text = "recognised plate, but the predicted end is uncertain: 0.52 rad, limit 0.35"
    assert uncertain_end(SETTINGS, state, {"rad": 0.52}) == text
    text = "recognised plate, but the predicted end is uncertain: 0.52 m, limit 0.1"
    assert uncertain_end(SETTINGS, state, {"rad": 0.52, "m": 0.52}) == text
    assert "not predicted" in uncertain_end(SETTINGS, state, None)
    state, _, _ = play([SURE["plate"]], state=state)
    assert state.active == "plate" and uncertain_end(SETTINGS, state, {"rad": 0.52}) == ""


@pytest.mark.parametrize(
    ("end_std", "active"),
    [
        ({"rad": 0.3, "m": 0.09}, "plate"),
        ({"rad": 0.3, "m": 0.11}, ""),
        ({"rad": 0.4, "m": 0.01}, ""),
        ({"m": 0.3}, ""),
        ({"deg": 0.01}, ""),
    ],
)
def test_the_end_must_be_certain_in_every_unit(end_std, active):
    state = DecisionState(candidate="plate", n_for=4)
    assert decide(SETTINGS, state, LABELS, np.array(SURE["plate"]), end_std)[1] == active


def test_an_active_task_stays_is_withdrawn_and_comes_back_or_is_over():
    state, _, _ = play([SURE["plate"]] * 5)
    _, active, events = play([(0.55, 0.3, 0.15)] * 50, state=state, end_std=2.0)
    assert set(active) == {"plate"} and events == []
    state, active, events = play([SURE["plate"]] * 5 + [(0.3, 0.51, 0.19)] * 5)
    assert active[-1] == "" and events[-1] == "withdrawn"
    assert play([SURE["plate"]] * 5, state=state)[1][-1] == "plate"
    state, active, events = play([SURE["plate"]] * 6 + [IDLE])
    assert active[-1] == "" and events == ["activated", "over"] and state.idle
    assert play([SURE["plate"]] * 4, state=state)[1][-1] == ""
    state, _, _ = play([SURE["plate"]] * 5)
    for _ in range(5):
        state, active = decide(
            SETTINGS, state, ("screw", "none"), np.array([0.6, 0.4]), {"rad": 0.1}
        )
    assert active == ""


simplex = st.lists(st.floats(0.0, 1.0), min_size=3, max_size=3).map(
    lambda x: tuple(np.array(x) / sum(x)) if sum(x) > 1e-3 else (0.5, 0.25, 0.25)
)
steps = st.lists(
    st.one_of(simplex, st.sampled_from([*SURE.values(), IDLE, UNCLEAR])), min_size=1, max_size=60
)


@given(steps, st.integers(1, 6))
def test_every_activation_is_backed_by_n_consecutive_observations(p, n):
    settings = DecisionSettings(n_observations=n)
    _, active, _ = play(p, settings)
    before = [""] + active[:-1]
    for k, (was, now) in enumerate(zip(before, active, strict=True)):
        if now and now != was:
            assert k + 1 >= n
            column = LABELS.index(now)
            assert all(p[j][column] >= settings.threshold for j in range(k - n + 1, k + 1))
        if was and now != was and p[k][2] < 1.0 - settings.idle_margin:
            rest = [k for k, label in enumerate(LABELS) if label != was]
            against = [max(np.array(p[j])[rest]) for j in range(k - n + 1, k + 1)]
            assert len(against) == n and min(against) > 1.0 - settings.release_below
        assert now != "none"


@pytest.mark.parametrize(
    ("labels", "p", "error"),
    [
        (LABELS, (0.5, 0.5), ShapeError),
        (("plate", "screw"), (0.5, 0.5), ArgumentError),
        (LABELS, (0.5, 0.5, np.nan), ArgumentError),
        (LABELS, (0.5, 0.7, -0.2), ArgumentError),
        (LABELS, (0.5, 0.3, 0.1), ArgumentError),
    ],
)
def test_what_is_no_distribution_is_refused(labels, p, error):
    with pytest.raises(error):
        decide(SETTINGS, DecisionState(), labels, np.array(p), {"rad": 0.1})


@pytest.mark.parametrize(
    "wrong",
    [
        {"threshold": 0.4},
        {"threshold": 1.1},
        {"n_observations": 0},
        {"max_end_std_rad": 0.0},
        {"max_end_std_m": -1.0},
        {"release_below": 0.95},
        {"switch_threshold": 1.1},
    ],
)
def test_settings_out_of_range_are_refused(wrong):
    with pytest.raises(ArgumentError):
        DecisionSettings(**wrong)


def test_a_habit_alone_activates_nothing():
    """Probable because it usually comes next: the movement itself must speak for it."""
    expected = np.array((0.95, 0.03, 0.02))
    for evidence, activates in (
        ((0.0, 0.0, 0.0), False),  # nothing seen yet
        ((0.0, 0.2, -9.0), False),  # what was seen speaks for another task
        ((0.0, -1.0, -9.0), True),
        ((0.0, -1.0, -0.5), True),
        ((0.0, -1.0, 9.0), False),  # what was seen speaks for none
        ((-800.0, -900.0, -np.inf), True),
        ((np.nan, 0.0, 0.0), False),
        (None, True),
    ):
        state = DecisionState()
        e = None if evidence is None else np.array(evidence)
        for _ in range(6):
            state, active = decide(SETTINGS, state, LABELS, expected, {"rad": 0.1}, e)
        assert (active == "plate") == activates, evidence
    for unknown in ([np.nan, 0.0, 0.0], [-np.inf, -np.inf, 0.0]):
        assert not is_evident(SETTINGS, LABELS, 0, np.array(unknown))


def test_evidence_is_no_further_condition_where_all_tasks_are_expected_alike(rng):
    for _ in range(200):
        log_evidence = rng.normal(size=3) * 5.0
        p = np.exp(log_evidence) * np.array([0.475, 0.475, 0.05])
        p /= p.sum()
        best = int(np.argmax(p))
        if LABELS[best] != "none" and p[best] >= SETTINGS.threshold:
            asked = replace(SETTINGS, min_evidence=SETTINGS.threshold - 1e-12)
            assert is_evident(asked, LABELS, best, np.append(log_evidence[:-1], -99.0))


RISK = risk_of(LeftOutOdds(tuple(np.linspace(-1.0, 2.0, 40)), ("",) * 40), 0.05)


def test_a_stated_risk_asks_for_a_probability_among_the_tasks():
    """What none keeps of the prior does not count against the tasks, as long as it is little."""
    settings, enough = DecisionSettings(risk=RISK), RISK.threshold + 1e-6
    for none in (0.0, 0.05, 0.1):
        known = (1.0 - none) * np.array([enough, 1.0 - enough])
        assert play([(*known, none)] * 5, settings)[1][-1] == "plate"
        short = (1.0 - none) * np.array([enough - 1e-3, 1.0 - enough + 1e-3])
        assert play([(*short, none)] * 9, settings)[1][-1] == ""
    assert play([(0.88, 0.01, 0.11)] * 9, settings)[1][-1] == ""


def test_another_task_than_the_one_active_last_needs_more_until_the_interaction_is_over():
    settings = DecisionSettings(risk=RISK._replace(threshold=0.6))
    short, enough = ((1.0 - p, p, 0.0) for p in settings.switch_threshold + np.array([-1e-6, 1e-6]))
    plate = [(0.7, 0.3, 0.0)] * 5
    assert play(plate + [short] * 50, settings)[1:] == (
        ["", "", "", ""] + ["plate"] * 5 + [""] * 46,
        ["activated", "withdrawn"],
    )
    assert play(plate + [enough] * 5, settings)[2] == ["activated", "switched"]
    found = play(plate + [short] * 9 + [enough] * 5, settings)[2]
    assert found == ["activated", "withdrawn", "activated"]
    again = play(plate + [short] * 9 + plate, settings)
    assert again[1][-1] == "plate" and again[0].last == "plate"
    _, active, _ = play(plate + [IDLE] + [short] * 5, settings)
    assert active[-1] == "screw"
    for p, last, possible in [
        (short, "plate", 2),
        (enough, "plate", 1),
        (short, "screw", 1),
        (short, "", 1),
        (plate[0], "plate", 1),
    ]:
        assert len(possible_tasks(settings, LABELS, np.array(p), last)) == possible


def test_a_smaller_share_of_wrong_actions_asks_for_more_and_leaves_one_task_or_several():
    settings = DecisionSettings(risk=RISK)
    for share in np.linspace(0.5, 0.999, 40):
        p = np.array([0.9 * share, 0.9 * (1.0 - share), 0.1])
        possible = possible_tasks(settings, LABELS, p)
        acted = settings.is_sure(LABELS, p, 0)
        assert possible == (("plate",) if acted else ("plate", "screw"))
    unsure = DecisionSettings(risk=RISK._replace(threshold=0.6))
    assert len(possible_tasks(unsure, ["a", "b", "c", "none"], np.array([0.3, 0.3, 0.3, 0.1]))) == 3
    odds = LeftOutOdds(tuple(np.linspace(-1.0, 2.0, 99)), ("",) * 99)
    plain = make_library(np.random.default_rng(0))
    library = replace(plain, left_out_odds=odds)
    risks = [learned_risk(library, share) for share in (0.2, 0.1, 0.05, 0.01)]
    thresholds = [risk.threshold for risk in risks]
    assert thresholds == sorted(thresholds)
    assert risks[0] == risk_of(odds, 0.2) == decision_settings(library, 0.2).risk
    assert learned_risk(plain) is None
