"""The board in Python and the board core in C side by side: random steps without a difference.

.venv/bin/python tests/benchmarks/board_pair.py [steps] [seed]      10^6 steps take some minutes
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from board_fuzz import BoardFuzzer
from board_pair import BoardPair


def main(steps: int = 1_000_000, seed: int = 0) -> None:
    fuzzer = BoardFuzzer(BoardPair(seed=seed), seed)
    began_s = time.perf_counter()
    for _ in range(steps):
        fuzzer.step()
    print(f"{steps} steps, seed {seed}, {time.perf_counter() - began_s:.0f} s: 0 differences")
    for name, times in sorted(fuzzer.reached.items()):
        print(f"  {name:24} {times}")
    print("not reached:", ", ".join(fuzzer.missing()) or "nothing")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
