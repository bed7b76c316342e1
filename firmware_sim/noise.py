"""Gaussian noise for sensors that are read a thousand times in a simulated second: drawn in blocks, by a seed."""

from __future__ import annotations

import numpy as np

BLOCK = 512


class Noise:
    """Calling it with a standard deviation gives the next deviation. The same seed gives the same ones."""

    def __init__(self, seed: int) -> None:
        self._generator = np.random.default_rng(seed)
        self._drawn: list[float] = []

    def __call__(self, sigma: float) -> float:
        """A deviation."""
        if not self._drawn:
            self._drawn = self._generator.standard_normal(BLOCK).tolist()
        return sigma * self._drawn.pop()
