"""The program of the microcontroller agrees with the core in this process, under random requests and faults."""

import pytest
from emulated_board import needs_emulator
from emulated_pair import EmulatedFuzzer, EmulatedPair

pytestmark = needs_emulator


def fuzzed(steps, seed):
    fuzzer = EmulatedFuzzer(EmulatedPair(seed), seed)
    for _ in range(steps):
        fuzzer.step()
    return fuzzer.made


def test_program_agrees_with_the_core():
    assert fuzzed(30, seed=1)["command"] > 5


@pytest.mark.exhaustive
def test_program_agrees_with_the_core_in_many_steps():
    made = fuzzed(2000, seed=2)
    assert min(made[f"mode {mode}"] for mode in (0, 1, 2)) > 100
    assert min(made.values()) > 10
