"""firmware-sim as a process, for the tests that need a real port."""

import contextlib
import re
import subprocess
import sys

import programs

COMMAND = [sys.executable, "-m", "firmware_sim.cli"]
SIM = "flexinol-lt-0.15mm"
PATIENT = "?latency_ms=2000"
"""A suffix of a URL. It permits the delay with which a process on a busy machine may reply."""


@contextlib.contextmanager
def served(*options, sim=SIM, cwd=None):
    """Start the simulator. Yield the process, and the first URL that it prints."""
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


def with_limits(text, watchdog_s, stale_after_s):
    """Return `text` of the rig file `simulated` with other limits: a busy machine may not keep the shipped ones."""
    limits = f"watchdog_s = {watchdog_s}\nstale_after_s = {stale_after_s}"
    text, replaced = re.subn(r"watchdog_s = .*\nstale_after_s = .*", limits, text)
    assert replaced == 1
    return text


def advance(process, time_s):
    """Move a simulator in lockstep time to `time_s`."""
    process.stdin.write(f"{time_s}\n")
    process.stdin.flush()
    assert float(process.stdout.readline()) == time_s
