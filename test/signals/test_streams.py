# SPDX-License-Identifier: Apache-2.0
"""Streams that do not belong together are named, with the likely cause; good ones are not."""

import re
from dataclasses import replace

import numpy as np
import pytest
from simulation import START_NS, minimum_jerk

from intent_recognition.signals import (
    Demonstration,
    Known,
    Signal,
    stream_doubts,
    summarise,
    time_misfit,
)
from intent_recognition.signals.streams import common_span, stream_defect

LENGTH_S = 10.0


def recording(name: str = "demo", *, reaction_s: float = 0.4, unit: str = "rad") -> Demonstration:
    """A human who reaches out and back, and a robot that does the same a little later; 50 Hz."""
    times_s = np.linspace(0.0, LENGTH_S, 501)
    stamps = START_NS + np.round(times_s * 1e9).astype(np.int64)

    def there_and_back(start_s: float) -> np.ndarray:
        return (minimum_jerk(times_s - start_s) - minimum_jerk((times_s - start_s - 3.0) / 1.5))[
            :, None
        ]

    human = Signal(("x",), stamps, 0.4 * there_and_back(2.0), "m")
    robot = Signal(("q",), stamps, 1.2 * there_and_back(2.0 + reaction_s), unit)
    return Demonstration(name, "", "reach", (human,), (robot,), int(stamps[0]), int(stamps[-1]))


def later(signal: Signal, shift_s: float) -> Signal:
    return replace(signal, stamps_ns=signal.stamps_ns + round(shift_s * 1e9))


def changed(recorded: Demonstration, of: str, change) -> Demonstration:
    return replace(recorded, **{of: tuple(map(change, getattr(recorded, of)))})


def with_robot(recorded: Demonstration, change) -> Demonstration:
    return changed(recorded, "controlled", change)


def cut(signal: Signal, first_s: float, last_s: float) -> Signal:
    return signal.between(START_NS + round(first_s * 1e9), START_NS + round(last_s * 1e9))


def without(signal: Signal, first_s: float, last_s: float) -> Signal:
    times_s = signal.seconds(START_NS)
    kept = (times_s <= first_s) | (times_s >= last_s)
    return replace(signal, stamps_ns=signal.stamps_ns[kept], values=signal.values[kept])


def times(signal: Signal, factor: float) -> Signal:
    return replace(signal, values=factor * signal.values)


def every(n: int, signal: Signal) -> Signal:
    return replace(signal, stamps_ns=signal.stamps_ns[::n], values=signal.values[::n])


def doubts(*recordings: Demonstration) -> list[str]:
    return [doubt.reason for doubt in stream_doubts([*map(summarise, recordings)])]


@pytest.mark.parametrize(
    ("of", "change", "words"),
    [
        ("controlled", lambda s: cut(s, 1.8, LENGTH_S), "begin 1.80 s later than the observed"),
        ("controlled", lambda s: later(s, 0.5), "begins and ends 0.50 s later .*two clocks"),
        ("controlled", lambda s: later(s, -0.5), "begins and ends 0.50 s earlier .*two clocks"),
        ("controlled", lambda s: without(s, 3.0, 4.5), "q has no sample for 1.5.*15% of the rec"),
        ("observed", lambda s: without(s, 3.0, 4.5), "x has no sample for 1.5.*15% of the rec"),
        ("controlled", lambda s: without(s, 3.0, 3.9), None),
        ("observed", lambda s: without(s, 3.0, 3.9), None),
        ("observed", lambda s: times(s, 0.0), "the observed agent does not move.*tracker"),
        ("observed", lambda s: times(s, 0.01), "the observed agent does not move"),  # by 4 mm
        ("observed", lambda s: times(s, 0.05), None),
        ("controlled", lambda s: times(s, 0.0), r"the controlled agent does not move \(by 0 rad"),
        ("observed", lambda s: every(25, s), "x was sampled at 2 Hz.*below 2.5 Hz"),
        ("observed", lambda s: every(10, s), None),
    ],
)
def test_what_is_doubtful_in_one_stream_is_named_and_nothing_else(of, change, words):
    recorded = changed(recording(), of, change)
    assert stream_defect(recorded) == ""
    found = doubts(recorded)
    assert len(found) == (words is not None) and all(re.search(words, one) for one in found)


def test_a_good_recording_has_neither_defect_nor_doubt_and_a_lag_that_is_the_reaction():
    good = [recording(f"{i}", reaction_s=0.3 + 0.05 * i) for i in range(6)]
    assert [stream_defect(one) for one in good] == [""] * 6
    assert stream_doubts([*map(summarise, good)]) == []
    assert summarise(recording(reaction_s=0.4)).lag_s == pytest.approx(0.4, abs=0.021)


@pytest.mark.parametrize(
    ("shift_s", "words"), [(-300.0, "ends 290 s before"), (300.0, "begins 290")]
)
def test_streams_that_do_not_overlap(shift_s, words):
    reason = stream_defect(with_robot(recording(), lambda s: later(s, shift_s)))
    assert "does not overlap" in reason and words in reason and "two clocks" in reason


def test_a_stream_that_ends_early_and_one_on_another_clock_are_told_apart():
    reason = stream_defect(with_robot(recording(), lambda s: cut(s, 0.0, 6.0)))
    assert "covers 60%" in reason and "ends 4.00 s before" in reason and "stopped early" in reason
    reason = stream_defect(with_robot(recording(), lambda s: later(s, 4.0)))
    assert "covers 60%" in reason and "two clocks" in reason


def test_what_is_missing_before_the_human_moves_is_a_doubt_and_after_it_a_defect():
    resting = with_robot(recording(), lambda s: cut(s, 1.8, LENGTH_S))
    assert common_span(resting) == (START_NS + 1_800_000_000, resting.end_ns)
    assert "covers 65%" in stream_defect(with_robot(recording(), lambda s: cut(s, 3.5, LENGTH_S)))


def test_a_clock_that_is_set_is_named():
    (doubt,) = doubts(replace(recording(), rejected={"stamp_not_increasing": 501}))
    assert "set back" in doubt


def test_a_human_observed_in_part_is_doubtful_and_one_alone_is_not():
    whole = recording()
    seen = cut(whole.observed[0], 0.0, 6.0)
    partly = replace(whole, observed=(seen,), end_ns=int(seen.stamps_ns[-1]))
    (doubt,) = doubts(partly)
    assert "end 4.00 s earlier" in doubt and "lost the body" in doubt
    alone = replace(recording(), controlled=())
    assert stream_defect(alone) == "" and doubts(alone) == []
    assert common_span(alone) == (alone.start_ns, alone.end_ns)


def test_a_shift_shows_beside_the_times_of_receipt():
    delayed = replace(recording(), delays_s=(0.02, 0.52))
    (doubt,) = doubts(delayed)
    assert "0.50 s behind" in doubt and "two clocks" in doubt
    assert doubts(replace(recording(), delays_s=(5.0, 5.1))) == []


@pytest.mark.parametrize("shift_s", [-0.5, 0.5])
def test_a_shift_whose_edges_were_cut_shows_in_the_speeds_as_a_hint(shift_s):
    """The lag of 0.4 s is everybody's; the one recording beside it is named, and only it."""

    def inner(signal: Signal) -> Signal:
        return cut(signal, 0.6, LENGTH_S - 0.6)

    good = [recording(f"{i}", reaction_s=0.36 + 0.02 * i) for i in range(5)]
    odd = with_robot(recording("odd"), lambda s: later(s, shift_s))
    odd = replace(
        with_robot(odd, inner),
        observed=tuple(map(inner, odd.observed)),
        start_ns=START_NS + 600_000_000,
        end_ns=START_NS + round((LENGTH_S - 0.6) * 1e9),
    )
    (doubt,) = stream_doubts([*map(summarise, [*good, odd])])
    side = "later" if shift_s > 0 else "earlier"
    assert doubt.name == "odd" and f"0.50 s {side}" in doubt.reason
    assert "A hint, no proof" in doubt.reason
    assert doubts(odd) == []  # nothing to compare it with


def test_millimetres_for_metres_and_degrees_for_radians():
    in_mm = recording()
    (human,) = in_mm.observed
    in_mm = replace(in_mm, observed=(times(human, 1000.0),))
    assert "millimetres for metres" in stream_defect(in_mm)
    robot = with_robot(recording(unit="m"), lambda s: times(s, 1000.0))
    assert "millimetres for metres" in stream_defect(robot)
    in_degrees = with_robot(recording(), lambda s: times(s, 180.0 / np.pi))
    assert stream_defect(in_degrees) == ""
    (doubt,) = doubts(in_degrees)
    assert "degrees for radians" in doubt


def scaled(recorded: Demonstration, factor: float) -> Demonstration:
    return with_robot(recorded, lambda s: times(s, factor))


def test_degrees_are_refused_where_the_limits_are_known():
    """Positions that fit in degrees are; others may be another arm's, and are doubted."""
    range_ = Known(np.array([-2.0]), np.array([2.0]))
    ours = replace(recording(), known=(range_,))
    assert stream_defect(ours) == "" and doubts(ours) == []
    for extent in (1.0, 1.72):  # 0.06 rad beyond the limits, as calibration may be
        in_degrees = scaled(ours, extent * 180.0 / np.pi)
        assert "degrees for radians (a factor of 57.3)" in stream_defect(in_degrees)
    turned = scaled(ours, 4.0)
    assert stream_defect(turned) == ""
    assert "whole turns" in doubts(turned)[0]


@pytest.mark.parametrize(
    ("unit", "factor", "name"),
    [("rad", 180.0 / np.pi, "degrees"), ("m", 1000.0, "millimetres"), ("m", 100.0, "centimetres")],
)
@pytest.mark.parametrize("odd", [0, 3])
def test_one_recording_of_four_in_another_unit_is_named(unit, factor, name, odd):
    """Small movements, so that nothing but the other recordings says so; or three of four."""
    few = [scaled(recording(f"{k}", unit=unit), 0.01) for k in range(4)]
    of_four = [scaled(one, factor) if k == odd else one for k, one in enumerate(few)]
    (doubt,) = stream_doubts([*map(summarise, of_four)])
    assert doubt.name == str(odd) and f"{name} for" in doubt.reason
    assert f"(a factor of {factor:.4g})" in doubt.reason and doubt.reason.endswith(", here.")
    most = [one if k == odd else scaled(one, factor) for k, one in enumerate(few)]
    assert [d.reason.split()[-1] for d in stream_doubts([*map(summarise, most)])][:1]


def test_a_hand_that_goes_farther_than_its_arm_reaches_is_refused():
    hand = replace(recording(unit="m"), known=(Known(widest=2.4),))
    assert stream_defect(hand) == ""
    assert "centimetres or inches for metres (a factor of 100 or 39.37)" in stream_defect(
        scaled(scaled(hand, 0.05), 100.0)
    )


@pytest.mark.parametrize("step_s", [1, 2, 4])
def test_milliseconds_and_numbers_of_samples_are_no_slow_tracker(step_s):
    """At 1000, 500 and 250 Hz these are steps that seconds could be."""
    slow = recording()
    stamps_ns = START_NS + step_s * 10**9 * np.arange(501)
    (human,), (robot,) = slow.observed, slow.controlled
    sides = (replace(human, stamps_ns=stamps_ns),), (replace(robot, stamps_ns=stamps_ns),)
    ends = int(stamps_ns[0]), int(stamps_ns[-1])
    slow = Demonstration("demo", "", "reach", *sides, *ends)
    reasons = doubts(slow)
    assert any("whole seconds. Likely milliseconds, or numbers of samples" in r for r in reasons)
    assert not any("Record it at 10 Hz" in reason for reason in reasons)


@pytest.mark.parametrize(("length_s", "late"), [(30.0, False), (300.0, True)])
def test_a_movement_too_slow_to_be_found_is_named(length_s, late):
    """0.3 m within that time, with 1 mm of noise."""
    times_s = np.arange(0.0, length_s + 4.0, 0.02)
    place = np.outer(minimum_jerk((times_s - 2.0) / length_s), [0.3, 0.0, 0.0])
    noise = np.random.default_rng(0).normal(0.0, 1e-3, place.shape)
    stamps = START_NS + np.round(times_s * 1e9).astype(np.int64)
    human = Signal(("x", "y", "z"), stamps, place + noise, "m")
    robot = Signal(("q",), stamps, 2.0 * place[:, :1], "rad")
    slow = Demonstration("demo", "", "lift", (human,), (robot,), int(stamps[0]), int(stamps[-1]))
    reasons = doubts(slow)
    assert any("found only after" in reason for reason in reasons) == late


def test_a_joint_may_rest_beside_others_and_two_labels_of_one_movement_are_named():
    still = scaled(recording(), 0.0)
    moving = replace(still, controlled=(*still.controlled, *recording().controlled))
    assert doubts(moving) == []
    first, second = recording("a"), replace(recording("b"), task="wave")
    found = stream_doubts([*map(summarise, [first, second])])
    assert [doubt.name for doubt in found] == ["a", "b"]
    assert "that of b, and the labels differ: reach and wave" in found[0].reason
    unlabelled = [summarise(replace(second, task=None)), summarise(first)]
    assert stream_doubts(unlabelled) == []


@pytest.mark.parametrize(
    ("period_s", "likely"),
    [
        (10.0, "milliseconds for seconds (a factor of 1000)"),
        (3e-5, "seconds for milliseconds (a factor of 0.001)"),
        (0.01 / 60.0, "minutes for seconds (a factor of 0.01667) or seconds for milliseconds"),
    ],
)
def test_the_unit_of_times_that_gives_a_usual_rate_is_named(period_s, likely):
    stamps_ns = 10**18 + np.rint(1e9 * period_s * np.arange(50)).astype(np.int64)
    found = time_misfit(Signal(("q",), stamps_ns, np.zeros((50, 1)), "rad"))
    assert found is not None and f"Likely {likely}" in found.reason
