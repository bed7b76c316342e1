"""The processes that a process has started."""

import contextlib
from pathlib import Path


def children(pid):
    """Return the running child processes, whichever thread has started them."""
    return [int(child) for task in Path(f"/proc/{pid}/task").glob("*/children") for child in task.read_text().split()]


def is_guardian(pid):
    """Return True if the process runs and is a guardian."""
    with contextlib.suppress(OSError):
        return b"smadrive.devices.guardian.process" in Path(f"/proc/{pid}/cmdline").read_bytes()
    return False


def guardians(pid):
    """Return the guardians among the child processes."""
    return list(filter(is_guardian, children(pid)))
