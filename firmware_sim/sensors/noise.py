"""Gaussian noise for sensors that are read a thousand times in a simulated second: drawn in blocks, by a seed."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

BLOCK = 512


def deviations(seed: int) -> Iterator[float]:
    """Deviates of standard deviation 1, without end. The same seed gives the same ones."""
    generator = np.random.default_rng(seed)
    while True:
        yield from generator.standard_normal(BLOCK)[::-1].tolist()
