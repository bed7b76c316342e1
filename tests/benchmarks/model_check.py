"""Search for an order of frames that makes the client accept a foreign reply.

    python tests/benchmarks/model_check.py [RUNS]

RUNS random sequences of up to 20 steps are tried for RTU and for Modbus TCP each (see tests/modbus_model.py). A failing
sequence is shrunk and printed, and the exit code is 1.
"""

import sys
import time
from pathlib import Path

from hypothesis import HealthCheck, Phase, settings
from hypothesis.stateful import run_state_machine_as_test

sys.path.insert(0, str(Path(__file__).parents[1]))

from modbus_model import BusMachine, NumberedBusMachine

STEPS = 20
CHUNK = 1000
"""Number of runs in a search. A search remembers all its runs, so more runs need more memory."""


def main():
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 100_000
    profile = settings(
        max_examples=CHUNK,
        stateful_step_count=STEPS,
        deadline=None,
        database=None,
        phases=(Phase.generate, Phase.shrink),
        suppress_health_check=list(HealthCheck),
    )
    for machine in (BusMachine, NumberedBusMachine):
        began_s = time.monotonic()
        for _ in range(0, runs, CHUNK):
            run_state_machine_as_test(machine, settings=profile)
        took_s = time.monotonic() - began_s
        print(f"{machine.__name__}: {runs} runs, no foreign reply accepted ({took_s:.0f} s)", flush=True)


if __name__ == "__main__":
    main()
