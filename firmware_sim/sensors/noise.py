"""Gaussian noise from a seed, computed in blocks because sensors need a thousand samples per simulated second."""

from __future__ import annotations

import numpy as np

BLOCK = 512


class Noise:
    """An endless series of Gaussian numbers with standard deviation 1. The same seed gives the same numbers.

    The series is not a Python generator, because Ctrl-C inside a generator would end the generator.
    """

    def __init__(self, seed: int) -> None:
        self._generator = np.random.default_rng(seed)
        self._block: list[float] = []

    def next(self) -> float:
        """Return the next number."""
        if not self._block:
            self._block = self._generator.standard_normal(BLOCK).tolist()
        return self._block.pop()
