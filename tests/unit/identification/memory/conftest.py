"""Wires of known memory: a bank of relays, a Duhem model, and mixtures of both; records and unseen loops."""

from itertools import pairwise

import numpy as np
import pytest

from smadrive.hysteresis import DuhemModel

COLD = 20.0
DUHEM = DuhemModel.gaussian(
    mu_heating=89.9, mu_cooling=69.0, sigma_heating=5.0, sigma_cooling=5.0, input_range=(COLD - 10, 200.0)
)


class MixedWire:
    """θ · a Duhem model + (1 - θ) · 4,000 relays, whose two thresholds have the correlation `correlation`."""

    def __init__(self, theta, correlation, rng):
        normal = rng.standard_normal((12_000, 2))
        up = 89.9 + 5.0 * normal[:, 0]
        down = 69.0 + 5.0 * (correlation * normal[:, 0] + np.sqrt(1 - correlation**2) * normal[:, 1])
        self.theta = theta
        self.up, self.down = up[up - down > 2.0][:4000], down[up - down > 2.0][:4000]

    def simulate(self, v):
        on = self.up <= v[0]
        relays = [on.mean()]
        for before, after in pairwise(v):
            on = on | (self.up <= after) if after > before else on & (self.down < after)
            relays.append(on.mean())
        return self.theta * DUHEM.simulate(v) + (1 - self.theta) * np.array(relays)


def path(turns, samples):
    """A path of about `samples` equal steps through the turning points."""
    step = np.abs(np.diff(turns)).sum() / samples
    parts = [np.linspace(a, b, max(2, int(np.ceil(abs(b - a) / step)) + 1))[1:] for a, b in pairwise(turns)]
    return np.concatenate([[turns[0]], *parts])


def reversal_curves(count=15, samples=3400):
    """First-order reversal curves from the cold end."""
    turns = [COLD]
    for peak in np.linspace(110.0, 78.0, count):
        turns += [peak, 50.0]
    return path(turns, samples)


def random_turns(rng, count, least):
    turns = [COLD, 110.0, 50.0]
    for number in range(count):
        last = turns[-1]
        turns.append(rng.uniform(last + least, 110.0) if number % 2 == 0 else rng.uniform(50.0, last - least))
    return turns


def nested_loops(rng, count=40, samples=2400):
    return path(random_turns(rng, count, 3.0), samples)


def errors_on_unseen_loops(model, wire, rng, count):
    """RMS and largest error on each of `count` unseen paths, % of the stroke, shape (count, 2)."""
    found = []
    for _ in range(count):
        v = path(random_turns(rng, 30, 0.5)[:1] + random_turns(rng, 30, 0.5)[3:], 1200)
        truth = wire.simulate(v)
        error = 100 * (model.simulate(v, truth[0]) - truth)
        found.append((np.sqrt(np.mean(error**2)), np.abs(error).max()))
    return np.array(found)


@pytest.fixture
def rng():
    return np.random.default_rng(7)
