"""The speed of the maths, against peers measured in the same run: python tests/benchmarks/hysteresis.py

It prints ratios and rates, and asserts no time.
"""

from __future__ import annotations

import time
import tracemalloc
from math import exp, pi, sqrt

import numpy as np
from scipy.integrate import solve_ivp
from scipy.special import ndtr

from smadrive.hysteresis import DuhemModel, InverseFeedforward, TriangularSets, TSFuzzyDuhem
from smadrive.identification import identify_tsfuzzy

PAPER = DuhemModel.table1()
RULES = TSFuzzyDuhem.from_duhem(PAPER, TriangularSets(tuple(np.linspace(-300, 300, 11))))


def mixed_loop(samples, turns=20, seed=0):
    corners = np.concatenate([[-300, 300], np.random.default_rng(seed).uniform(-280, 280, turns)])
    return np.interp(np.linspace(0, len(corners) - 1, samples), np.arange(len(corners)), corners)


def seconds(action, repeats=5):
    """Return the shortest time of a few runs."""
    best = np.inf
    for _ in range(repeats):
        start = time.perf_counter()
        action()
        best = min(best, time.perf_counter() - start)
    return best


def duhem_slope(v, w, rising):
    """Return the slope by eq. (5) of the paper for Table 1 (corrected), for an ODE solver."""
    heating, cooling = (v - 35) / 75, (v + 45) / 70
    gap = ndtr(cooling) - ndtr(heating)
    if rising:
        return (ndtr(cooling) - w) / gap * exp(-(heating**2) / 2) / (75 * sqrt(2 * pi))
    return (w - ndtr(heating)) / gap * exp(-(cooling**2) / 2) / (70 * sqrt(2 * pi))


def rule_slope(v, w, rising):
    """Return the slope by eqs. (10) and (11) of the paper with dv in place of dt, for an ODE solver."""
    a, b = RULES.heating_law if rising else RULES.cooling_law
    return np.interp(v, RULES.sets.centres, a) * w + np.interp(v, RULES.sets.centres, b)


def ode_seconds_per_sample(model, slope):
    """Return the time per sample of a peer: solve_ivp(RK45, rtol 1e-6) on each monotonic part of the same input."""
    v = mixed_loop(1001, turns=3)
    turns = np.flatnonzero(np.diff(np.sign(np.diff(v)))) + 1

    def solve():
        w = model.initial_state(v[0]).w
        for part in np.split(np.arange(len(v)), turns + 1):
            v0, v1 = v[max(part[0] - 1, 0)], v[part[-1]]
            span, options = (v0, v1), {"method": "RK45", "rtol": 1e-6, "t_eval": v[part], "args": (bool(v1 > v0),)}
            w = solve_ivp(slope, span, [w], **options).y[0, -1]

    return seconds(solve, 2) / len(v)


def report_simulation(name, model, slope):
    v = mixed_loop(1_000_000)
    model.simulate(v[:10])
    ours = seconds(lambda: model.simulate(v))
    exponential = seconds(lambda: np.exp(v * 0.01)) - seconds(lambda: v * 0.01)
    ode = ode_seconds_per_sample(model, slope) * len(v)
    print(f"{name}: 1e6 samples = {ours / exponential:.1f} x one numpy.exp pass, {ode / ours:,.0f} x faster than RK45")


def report_stepping(name, model):
    path, state = mixed_loop(50_000).tolist(), model.initial_state(-300.0)
    model.step(state, 0.0)

    def run():
        now = state
        for v in path:
            now = model.step(now, v)

    print(f"{name}: {len(path) / seconds(run):,.0f} steps/s one by one")


def report_inverse(name, model):
    start = model.initial_state(-300.0)
    wanted = model.simulate(mixed_loop(20_000))
    inverse = InverseFeedforward(model)
    elapsed = seconds(lambda: inverse.trajectory(wanted, start.v), 3)
    result = inverse.trajectory(wanted, start.v)
    reached = model.simulate(np.concatenate([[start.v], result.v]), start.y)[1:]
    error = np.max(np.abs(reached - wanted)[result.reachable]) / abs(model.scale)
    print(f"{name}: {len(wanted) / elapsed:,.0f} inversions/s with their steps, round trip {error:.1e} of the scale")


def report_identification():
    for samples in (10_000, 40_000):
        v = mixed_loop(samples, turns=60)
        y = PAPER.simulate(v)
        forward = seconds(lambda v=v: RULES.simulate(v))
        elapsed = seconds(lambda v=v, y=y: identify_tsfuzzy(v, y), 1)
        tracemalloc.start()
        fit = identify_tsfuzzy(v, y)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        print(
            f"identify_tsfuzzy, {samples} samples: {elapsed / forward:,.0f} forward simulations, "
            f"{peak / samples:,.0f} bytes per sample at most, {fit.rms_percent:.3f} % RMS"
        )


def main():
    for name, model, slope in (("Duhem", PAPER, duhem_slope), ("T-S fuzzy", RULES, rule_slope)):
        report_simulation(name, model, slope)
        report_stepping(name, model)
        report_inverse(name, model)
    report_identification()


if __name__ == "__main__":
    main()
