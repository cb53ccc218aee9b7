# SPDX-License-Identifier: Apache-2.0
"""The benchmarks compare like with like, and say what they found."""

import json

import numpy as np
import pytest

from benchmarks import __main__ as command
from benchmarks.measure import Result
from benchmarks.textbook import full_state_update
from intent_recognition.gaussian.normal import Gaussian, condition


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


def test_textbook_peer_computes_what_the_library_does():
    rng = np.random.default_rng(3)
    root = rng.normal(size=(6, 6))
    prior = Gaussian(rng.normal(size=6), root @ root.T + np.eye(6))
    matrix, values, noise = rng.normal(size=(2, 6)), rng.normal(size=2), 0.3 * np.eye(2)
    mean, covariance, log_density = full_state_update(*prior, matrix, values, noise)
    expected, expected_density = condition(prior, matrix, values, noise)
    np.testing.assert_allclose(mean, expected.mean, rtol=1e-9)
    np.testing.assert_allclose(covariance, expected.covariance, atol=1e-9)
    assert log_density == pytest.approx(expected_density)


@pytest.fixture
def one_result(monkeypatch):
    monkeypatch.setattr(
        command, "results", lambda: iter([Result("thing", 9.0, 2.0, "at most", "ms")])
    )


def test_a_shortfall_is_said_and_still_exits_with_zero(one_result, capsys):
    assert command.main([]) == 0
    assert "falls short" in capsys.readouterr().out


def test_json_alone_is_json_and_nothing_else(one_result, capsys):
    assert command.main(["--json"]) == 0
    (entry,) = json.loads(capsys.readouterr().out)
    assert entry["name"] == "thing" and entry["required"] == 2.0


def test_json_to_a_file_comes_beside_the_lines(one_result, capsys, tmp_path):
    assert command.main(["--json", str(tmp_path / "bench.json")]) == 0
    assert "thing" in capsys.readouterr().out
    assert json.loads((tmp_path / "bench.json").read_text())[0]["verdict"] == "falls short"
