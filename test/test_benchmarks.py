# SPDX-License-Identifier: Apache-2.0
"""The benchmarks compare like with like, say what they found, and keep the pace of the nodes."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from plain import bank_of

from benchmarks import __main__ as command
from benchmarks.bank import Stream
from benchmarks.bank_memory import growth, long_run
from benchmarks.bank_numerics import one_movement
from benchmarks.measure import Result
from benchmarks.pace_keeper import LAG_HIGH_S, LAG_LOW_S, SLOWEST, next_factor
from benchmarks.soak import Soak, Usage, results
from benchmarks.synthetic import DURATION_S, synthetic_library
from intent_recognition.filtering.grid import fixed_prior_grid
from intent_recognition.gaussian import Gaussian, condition
from intent_recognition.promp.basis import NormalizedRBFBasis


@pytest.mark.parametrize(
    ("measured", "direction", "verdict"),
    [
        (1.0, "at most", "ok"),
        (3.0, "at most", "falls short"),
        (3.0, "at least", "ok"),
        (1.0, "at least", "falls short"),
    ],
)
def test_verdict_follows_the_direction(measured, direction, verdict):
    result = Result("thing", measured, 2.0, direction, "ms")
    assert result.verdict == verdict
    assert verdict in result.line()
    assert result.to_dict()["verdict"] == verdict


@pytest.mark.parametrize("name", ["movement_primitives", "filterpy", "simdkalman"])
def test_peers_of_the_filter_bank_compute_what_it_does(name):
    peers = pytest.importorskip("benchmarks.bank_peers")
    library = synthetic_library(np.random.default_rng(3), 2)
    width = 19 / np.sqrt(-8.0 * 20**2 * np.log(0.7))  # movement_primitives knows no other
    library = replace(library, basis=NormalizedRBFBasis(20, width))
    noise, values, phase = 1e-4 * np.eye(3), np.array([0.1, -0.2, 0.3]), 0.4
    prior = Gaussian(library.observed_mean[0], library.observed_covariance[0])
    rows = np.kron(np.eye(3), library.basis.design_matrix(np.array([phase])))
    ours, _ = condition(prior, rows, values, noise)
    mean, covariance = getattr(peers, name)(library, noise, values, phase)()
    np.testing.assert_allclose(mean, ours.mean, atol=1e-6)
    np.testing.assert_allclose(covariance, ours.covariance, atol=1e-8)


def test_rows_that_the_bank_is_given_are_those_that_it_finds_itself():
    library = synthetic_library(np.random.default_rng(3), 3)
    grid = fixed_prior_grid(library, DURATION_S)
    streams = [Stream(library, grid, rows_given=given) for given in (False, True)]
    for stream in streams:
        for _ in range(3):
            stream.next()()
    np.testing.assert_allclose(streams[1].given.mean, bank_of(streams[0].run).mean, atol=1e-12)


def test_a_process_of_a_soak_grows_from_the_middle_of_its_life_to_its_end():
    """Samples every ten seconds: 40 MB in the first two minutes, then 3 MB more each minute."""
    minutes = np.arange(0.0, 8.0, 1 / 6)
    memory = 60.0 + 20.0 * np.minimum(minutes, 2.0) + 3.0 * minutes
    rising = [
        Usage(60.0 * m, mb, 20, 30 + (m > 7.0)) for m, mb in zip(minutes, memory, strict=True)
    ]
    soak = Soak(usage={("estimator", 0): rising, ("estimator", 1): rising[:12]})
    grown, whose = soak.growth(1)
    assert grown == pytest.approx(3.0 * 3.0, abs=0.5) and whose.startswith("estimator, start 0,")
    assert soak.growth(2)[0] == 0 and soak.growth(3)[0] == 1
    soak.recognised, soak.disturbed = [True, True, False], 2
    verdicts = {result.name: result.verdict for result in results(soak, 6.0)}
    assert verdicts["soak: undisturbed interactions recognised"] == "falls short"
    assert verdicts["soak: memory of a process grew by"] == "falls short"
    assert verdicts["soak: file descriptors grew by"] == "ok"


@pytest.fixture
def one_result(monkeypatch):
    result = Result("thing", 9.0, 2.0, "at most", "ms")
    monkeypatch.setattr(command, "results", lambda *minutes: iter(["Things", result]))


def test_a_shortfall_is_said_and_still_exits_with_zero(one_result, capsys):
    assert command.main([]) == 0
    out = capsys.readouterr().out
    assert out.startswith("\nThings\nthing ")
    assert "\n0 of 1 hold; " in out and "\n  falls short: thing\n" in out


def test_one_joint_gaussian_is_what_the_filter_computes():
    for result in one_movement(2):
        assert result.verdict == "ok", result.line()


@pytest.mark.slow
def test_a_long_run_ends_at_its_limit_of_time():
    with long_run(0.0) as process:
        assert "from 800 to 800 observations" in growth(process).remark


factors = st.floats(0.2, 5.0)


@given(factors, factors, st.floats(0.0, 10.0))
def test_never_faster_than_asked_and_never_still(factor, asked, lag):
    new = next_factor(min(factor, asked), asked, lag)
    assert min(SLOWEST, asked) <= new <= asked


@given(factors)
def test_slows_down_while_lagging_and_comes_back(asked):
    factor = asked
    for _ in range(30):
        factor = next_factor(factor, asked, LAG_HIGH_S * 1.01)
    assert factor == min(SLOWEST, asked)
    for _ in range(60):
        factor = next_factor(factor, asked, LAG_LOW_S * 0.99)
    assert factor == asked


def test_holds_in_between():
    assert next_factor(0.7, 2.0, 0.5 * (LAG_LOW_S + LAG_HIGH_S)) == 0.7
