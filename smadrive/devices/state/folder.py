"""The folder in which driver, guardian and `off` keep state that outlives a process: trips, locks, duties."""

from __future__ import annotations

import os
from pathlib import Path

from smadrive.errors import SafetyError

WITHOUT_HOME = Path("/var/lib/smadrive")


def state_dir() -> Path:
    """Return `$XDG_STATE_HOME/smadrive`, or `~/.local/state/smadrive` without that variable.

    For a user without a home folder, return `WITHOUT_HOME`. The folder may not exist yet.
    """
    if folder := os.environ.get("XDG_STATE_HOME"):
        return Path(folder) / "smadrive"
    try:
        return Path.home() / ".local" / "state" / "smadrive"
    except RuntimeError:  # the user has no home folder, but must be able to switch a heater off
        return WITHOUT_HOME


def unreadable(error: OSError) -> SafetyError:
    """Return the error for a program that needs the content of the folder but cannot list it."""
    return SafetyError(
        "the state folder cannot be read",
        where=error.filename or state_dir(),
        value=error.strerror,
        cure=f"give this folder to your user (`sudo chown -R $USER {state_dir()}`), or set XDG_STATE_HOME to a folder "
        "of your own",
    )
