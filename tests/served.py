"""firmware-sim as a process, for the tests that need the real thing on a real port."""

import contextlib
import subprocess
import sys

import programs

COMMAND = [sys.executable, "-m", "firmware_sim.cli"]
SIM = "flexinol-lt-0.15mm"


def patient(url):
    """The address, with time for replies that are late on a busy machine."""
    return f"{url}?latency_ms=2000"


@contextlib.contextmanager
def served(*options, sim=SIM, cwd=None):
    """The process, its first URL read."""
    with programs.Program(
        [*COMMAND, *([] if sim is None else [sim]), *options],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=cwd,
    ) as process:
        try:
            yield process, process.stdout.readline().strip()
        finally:
            process.kill()


def advance(process, time_s):
    """Let the time of a simulator in driven time reach `time_s`."""
    process.stdin.write(f"{time_s}\n")
    process.stdin.flush()
    assert float(process.stdout.readline()) == time_s
