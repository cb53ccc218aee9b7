# SPDX-License-Identifier: Apache-2.0
"""The measurement of an open page judges what it measured."""

import pytest

pytest.importorskip("diagnostic_msgs")

from benchmarks import page as benchmark
from benchmarks.browser import PageSize

MINUTES = 60


def samples(server_mb_an_hour=0.0, heap_mb_an_hour=0.0, objects_an_hour=0.0):
    """An hour, one sample a minute; each minute a little more or less."""
    found = []
    for k in range(1, MINUTES + 1):
        noise, hour = (-1) ** k, k / 60
        size = PageSize(
            heap_mb=30 + 0.2 * noise + heap_mb_an_hour * hour,
            renderer_mb=300.0,
            elements=500 + noise,
            listeners=100,
            objects=90 + round(objects_an_hour * hour),
            geometries=40,
            textures=5,
            waiting=0,
        )
        server_mb = 200 + 0.3 * noise + server_mb_an_hour * hour
        found.append(benchmark.Sample(60.0 * k, server_mb, 0.18, 25.0, size))
    return found


def verdicts(found):
    return [result.verdict for result in (*benchmark.growth(found), *benchmark.counts(found))]


def test_a_page_that_stays_as_it_is_holds():
    assert set(verdicts(samples())) == {"ok"}
    assert [result.measured for result in benchmark.cost(samples())] == pytest.approx([18.0, 25.0])


@pytest.mark.parametrize("grows", ["server_mb_an_hour", "heap_mb_an_hour", "objects_an_hour"])
def test_one_that_grows_falls_short_in_one_line(grows):
    assert verdicts(samples(**{grows: 30.0})).count("falls short") == 1


def test_without_a_browser_it_is_said_and_left_out(monkeypatch):
    monkeypatch.setattr(benchmark, "chromium", lambda: None)
    assert list(benchmark.page(None)) == ["The page: left out, there is no Chromium"]
