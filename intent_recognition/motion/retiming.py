# SPDX-License-Identifier: Apache-2.0
"""Speed limits along a path, and progress along it that lets a late start catch up.

The path parameter is the phase s of the interaction. Joint accelerations are
q'' = p'(s) s'' + p''(s) s'^2, linear in (s'', s'^2), so their limits are half planes at every s.
The largest s'^2 from which the end can still be reached at rest follows from one backward pass
over a grid (time-optimal path parametrisation by reachability, Pham and Pham 2018).
"""

from math import inf
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.motion.path import JointPath
from intent_recognition.motion.plan import STEP_S

N_GRID = 100
"""Intervals of the grid over the phase, each 1 % of an interaction."""


class NominalTiming(NamedTuple):
    """When the predicted interaction happens: s = (t - onset_s) / duration_s.

    `onset_s` counts from the plan's start, so it is negative for a movement already under way.
    """

    onset_s: float
    duration_s: float


class SpeedLimits(NamedTuple):
    """Bounds along a path on a grid of G intervals; x = s'^2.

    On interval i: -a[i] - b[i] x <= s'' <= a[i] - b[i] x in every column (the joints at both ends
    of the interval, then the bound on s'' itself). `cap` (G + 1,) is the largest x from which the
    end can be reached at rest.
    """

    a: Floats
    b: Floats
    cap: tuple[float, ...]


_Bounds = tuple[float, list[tuple[float, float]]]


class PathProgress(NamedTuple):
    """Phase and phase rate at increasing times, each (T,); the last rate is zero."""

    times_s: Floats
    phase: Floats
    rate: Floats


def speed_limits(
    path: JointPath,
    max_velocity: Floats,
    max_acceleration: Floats,
    share: Floats,
    rate_ceiling: Floats | None,
) -> SpeedLimits:
    """Bounds on the speed along a path that may use these joint limits (n,) [rad/s, rad/s^2].

    In each interval, `share` (G,) is the share of both limits to use, and `rate_ceiling` (G,) the
    largest phase rate [1/s].
    """
    grid = np.linspace(0.0, 1.0, N_GRID + 1)
    first, second = path.derivative(grid), path.derivative(grid, 1)
    slope = np.maximum(np.abs(first), 1e-6)
    a = max_acceleration / slope
    b = second * np.where(first < 0.0, -1.0, 1.0) / slope
    # 15 times the predicted rate per second: bounds s'' where no joint moves
    largest = 15.0 / path.duration_s
    own = np.full((N_GRID, 1), largest)
    room = _largest_with_room(a, b, largest)
    a = np.hstack([a[:-1], a[1:], own]) * share[:, None]
    b = np.hstack([b[:-1], b[1:], np.zeros_like(own)])
    # at most six times as fast as predicted: bounds s' where no joint moves
    fastest = np.minimum((max_velocity / slope).min(axis=1), 6.0 / path.duration_s) ** 2
    fastest = np.minimum(fastest[:-1], fastest[1:])
    if rate_ceiling is not None:
        fastest = np.minimum(fastest, rate_ceiling**2)
    fastest *= share**2
    ceiling = np.minimum(fastest, np.minimum(room[:-1], room[1:]) * share)
    return SpeedLimits(a, b, tuple(_backward(a, b, ceiling).tolist()))


def _largest_with_room(a: Floats, b: Floats, own: float) -> Floats:
    """Largest x (G + 1,) with room for s'' between the bounds of joints (G + 1, n) and `own`."""
    a = np.hstack([a, np.full((len(a), 1), own)])
    b = np.hstack([b, np.zeros((len(b), 1))])
    difference = np.maximum(b[:, :, None] - b[:, None, :], 1e-300)
    with np.errstate(over="ignore"):
        return ((a[:, :, None] + a[:, None, :]) / difference).min(axis=(1, 2))


def _backward(a: Floats, b: Floats, ceiling: Floats) -> Floats:
    """Largest x (G + 1,) from which the end can be reached at rest within the bounds."""
    step = 2.0 / N_GRID
    gain = 1.0 - step * b
    brakes = gain > 0.0
    divisor = np.where(brakes, gain, 1.0)
    constant = np.where(brakes, step * a / divisor, np.inf)
    factor = np.where(brakes, 1.0 / divisor, 0.0)
    cap = np.zeros(N_GRID + 1)
    for i in range(N_GRID - 1, -1, -1):
        cap[i] = min((cap[i + 1] * factor[i] + constant[i]).min(), ceiling[i])
    np.minimum(cap[1:-1], ceiling[:-1], out=cap[1:-1])
    return cap


def largest_rate(limits: SpeedLimits, phase: float) -> float:
    """Largest phase rate [1/s] allowed at a phase."""
    i = min(int(phase * N_GRID), N_GRID - 1)
    share = phase * N_GRID - i
    return max(limits.cap[i] * (1.0 - share) + limits.cap[i + 1] * share, 0.0) ** 0.5


def shortest_s(limits: SpeedLimits, phase: float) -> float:
    """Shortest time within the limits from a phase to the end [s]."""
    grid = np.linspace(0.0, 1.0, N_GRID + 1)
    rate = np.sqrt(limits.cap)
    with np.errstate(divide="ignore"):
        each_s = 2.0 / N_GRID / (rate[:-1] + rate[1:])
    return float(np.sum(each_s[grid[1:] > phase]))


def run(
    limits: SpeedLimits,
    phase: float,
    rate: float,
    nominal: NominalTiming | None,
    *,
    step_s: float,
    hold_s: float = 0.0,
) -> PathProgress | None:
    """Progress along the path: as fast as allowed while behind the nominal timing, then with it.

    The wanted rate is the nominal rate plus a correction for the lag: proportional to a small lag,
    to the square root of a large one, so that joining the nominal timing by braking is feasible.
    Ahead of the nominal timing the progress slows down, at most to a stop, and never goes back.
    Without a nominal timing it brakes to a stop as fast as allowed. `phase` and `rate`, at most
    `largest_rate`, are those at time 0; from rest, progress begins after `hold_s`.

    Returns:
        The progress until it stops (at phase 1 unless braking), or None after 1500 steps: 150 s at
        the longest step of 0.1 s under limits of 8 rad/s^2 (`plan.plan_step`).
    """
    bounds = _bounds(limits)
    times, phases, rates = [0.0], [phase], [rate]
    t, s, v = 0.0, phase, rate
    for _ in range(1500):
        left = 1.0 - s
        if left <= 1e-9 or (nominal is None and v <= 0.0):
            break
        if v > 0.0 and left <= v * step_s:  # brake evenly to the end
            t, s, v = t + 2.0 * left / v, 1.0, 0.0
        else:
            v_next = _next_rate(limits, bounds, s, v, t, nominal, step_s)
            if t < hold_s and v <= 0.0:
                v_next = 0.0
            t, s, v = t + step_s, s + step_s * (v + v_next) / 2.0, v_next
        times.append(t)
        phases.append(s)
        rates.append(v)
    else:
        return None
    rates[-1] = 0.0
    return PathProgress(np.array(times), np.array(phases), np.array(rates))


def _bounds(limits: SpeedLimits) -> list[_Bounds]:
    """The cap of x in each interval, and the pairs (a, b) that can bind under it."""
    caps = np.maximum(limits.cap[:-1], limits.cap[1:])
    bend = np.abs(limits.b) * caps[:, None]
    binds = limits.a - bend <= (limits.a + bend).min(axis=1, keepdims=True)
    rows = zip(caps.tolist(), limits.a, limits.b, binds, strict=True)
    return [(x, list(zip(a[k].tolist(), b[k].tolist(), strict=True))) for x, a, b, k in rows]


def _next_rate(
    limits: SpeedLimits,
    bounds: list[_Bounds],
    s: float,
    v: float,
    t: float,
    nominal: NominalTiming | None,
    step_s: float,
) -> float:
    """The phase rate one step later; `bounds` are those of each interval."""
    low, high = _phase_acceleration(bounds, s, v, step_s)
    wanted = 0.0
    if nominal is not None and t >= nominal.onset_s:
        own = 1.0 / nominal.duration_s
        lag = (t + step_s - nominal.onset_s) * own - s - v * step_s / 2.0
        wanted = max(own + _approach(lag, 0.5 * max(-low, 0.1 * own)), 0.0)
    v_next = max(v + min(max((wanted - v) / step_s, low), high) * step_s, 0.0)
    if v_next > v:
        _, high = _phase_acceleration(bounds, s, v_next, step_s)
        while v <= 0.0 and high <= 0.0:  # a long step from rest
            v_next *= 0.5
            _, high = _phase_acceleration(bounds, s, v_next, step_s)
        v_next = max(min(v_next, v + high * step_s), min(v, v_next))
    # within a step s'^2 is linear in s: a long one keeps under the cap at the grid points it passes
    passed = range(int(s * N_GRID + 1e-4) + 1, N_GRID) if step_s > STEP_S else ()
    for i in passed:
        ahead = i / N_GRID - s
        if 2.0 * ahead >= (v + v_next) * step_s:
            break
        under = v + (limits.cap[i] - v * v) * step_s / (2.0 * ahead)
        v_next = min(v_next, max(under, 2.0 * ahead / step_s - v, v + low * step_s, 0.0))
    return _under_cap(limits, s + step_s * v / 2.0, v_next, step_s / 2.0)


def _under_cap(limits: SpeedLimits, s: float, v_next: float, half_step_s: float) -> float:
    """The largest rate up to v_next that is allowed at the phase it leads to.

    The square of the largest rate is linear in each interval of the grid: the rate is the larger
    root of a quadratic in the last interval that holds it.
    """
    end = min(s + half_step_s * v_next, 1.0)
    if v_next <= largest_rate(limits, end):
        return v_next
    for i in range(min(int(end * N_GRID), N_GRID - 1), int(s * N_GRID) - 1, -1):
        bend = (limits.cap[i + 1] - limits.cap[i]) * N_GRID
        half = 0.5 * bend * half_step_s
        square = half * half + limits.cap[i] + bend * (s - i / N_GRID)
        if square >= 0.0:
            rate = max(half + square**0.5, 0.0)
            if i / N_GRID - 1e-12 <= s + half_step_s * rate <= min((i + 1) / N_GRID, end) + 1e-12:
                return rate
    return 0.0


def _phase_acceleration(
    bounds: list[_Bounds], s: float, v: float, step_s: float
) -> tuple[float, float]:
    """Lowest and highest s'' that keep the limits in every interval that the step touches.

    No interval is reached above its cap: at a larger x, a joint that turns there leaves no room.
    """
    first = min(int(s * N_GRID), N_GRID - 1)
    last = min(int((s + v * step_s) * N_GRID), N_GRID - 1) + 1
    least, high = inf, inf
    for cap, pairs in bounds[first:last]:  # numpy takes three times as long for so few numbers
        x = min(v * v, cap)
        for a, b in pairs:
            bend = b * x
            if a + bend < least:
                least = a + bend
            if a - bend < high:
                high = a - bend
    low = -least
    if low > high:
        low = high = 0.5 * (low + high)
    return low, high


def _approach(lag: float, deceleration: float) -> float:
    """Rate correction for a lag: linear if small, else such that braking keeps to deceleration."""
    gain = 6.0  # [1/s], of a small lag
    linear = deceleration / gain**2
    size = abs(lag)
    if size <= linear:
        return gain * lag
    return (2.0 * deceleration * (size - linear / 2.0)) ** 0.5 * (1.0 if lag > 0.0 else -1.0)
