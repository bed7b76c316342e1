"""The folder of driver, guardian and `off` for state that outlives a process: trips, locks, duties."""

from __future__ import annotations

import os
from pathlib import Path

from smadrive.errors import SafetyError

WITHOUT_HOME = Path("/var/lib/smadrive")


def state_dir() -> Path:
    """`$XDG_STATE_HOME/smadrive`, in `~/.local/state` without that variable; it need not exist."""
    if folder := os.environ.get("XDG_STATE_HOME"):
        return Path(folder) / "smadrive"
    try:
        return Path.home() / ".local" / "state" / "smadrive"
    except RuntimeError:  # a user without a home must be able to switch a heater off
        return WITHOUT_HOME


def unreadable(error: OSError) -> SafetyError:
    """The error of a program that needs the content of the folder and cannot list it."""
    return SafetyError(
        "the state folder cannot be read",
        where=error.filename or state_dir(),
        value=error.strerror,
        cure=f"give it to your user (`sudo chown -R $USER {state_dir()}`), or set XDG_STATE_HOME to your own folder",
    )
