"""Gaussian noise from a seed, computed in blocks because sensors need a thousand samples per simulated second."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

BLOCK = 512


def deviations(seed: int) -> Iterator[float]:
    """Yield Gaussian numbers of standard deviation 1 without end. The same seed gives the same numbers."""
    generator = np.random.default_rng(seed)
    while True:
        yield from generator.standard_normal(BLOCK)[::-1].tolist()
