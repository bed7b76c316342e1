"""Noise has the same numbers for a seed, whatever interrupts it."""

import signal

import numpy as np
import pytest

from firmware_sim.sensors.noise import BLOCK, Noise


def test_seed_gives_the_same_numbers():
    first, second = Noise(3), Noise(3)
    numbers = [first.next() for _ in range(3 * BLOCK)]
    assert numbers == [second.next() for _ in range(3 * BLOCK)]
    assert abs(np.mean(numbers)) < 0.1
    assert np.std(numbers) == pytest.approx(1.0, abs=0.05)


class Interrupted(Exception):
    pass


def interrupt(_number, frame):
    if frame.f_code is Noise.next.__code__:
        raise Interrupted


def test_interruption_does_not_end_the_noise():
    noise, interruptions = Noise(3), 0
    before = signal.signal(signal.SIGVTALRM, interrupt)
    signal.setitimer(signal.ITIMER_VIRTUAL, 1e-4, 1e-4)
    try:
        while interruptions < 20:
            try:
                noise.next()
            except Interrupted:
                interruptions += 1
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, before)
    assert np.isfinite(noise.next())
