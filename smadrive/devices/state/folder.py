"""The folder in which driver, guardian and `off` keep what must outlive them: trips, locks, duties."""

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
    except RuntimeError:  # a user without a home: neither this nor a lock may keep a heater from being switched off
        return WITHOUT_HOME


def unreadable(error: OSError) -> SafetyError:
    """The error of a program that must know what the folder holds, and cannot list it."""
    return SafetyError(
        f"the state folder cannot be read: {error.filename or state_dir()} ({error.strerror}): give it to your user "
        f"(`sudo chown -R $USER {state_dir()}`), or set XDG_STATE_HOME to a folder of your own"
    )
