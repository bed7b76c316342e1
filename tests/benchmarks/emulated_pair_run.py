"""The program of the microcontroller beside the core, for many random steps.

    python tests/benchmarks/emulated_pair_run.py [--steps 10000] [--seed 0]

A difference is an AssertionError with the request and both replies. The last line has the number of steps of each kind.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from emulated_pair import EmulatedFuzzer, EmulatedPair


def main() -> None:
    """Make the steps and print their kinds."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--steps", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    fuzzer = EmulatedFuzzer(EmulatedPair(options.seed), options.seed)
    for _ in range(options.steps):
        fuzzer.step()
    print(f"{options.steps} steps, {fuzzer.pair.now_ms / 1000:.0f} s of the board, no difference: {dict(fuzzer.made)}")


if __name__ == "__main__":
    main()
