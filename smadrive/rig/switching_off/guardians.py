"""Guardians (processes that switch a heat source off after a driver failed) that still wait for their devices."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress

from smadrive.devices.guardian.duty import waiting_duties
from smadrive.errors import SafetyError, SmadriveError


def waiting_guardians() -> list[str]:
    """Return one text with a cure for each waiting guardian. SafetyError if the state folder is unreadable."""
    return [str(duty) for duty in waiting_duties()]


@contextmanager
def notes_waiting_guardians() -> Iterator[None]:
    """Add a note for each waiting guardian to an error in the `with` block.

    The device that caused the error may be the one that a guardian waits for.
    """
    try:
        yield
    except SmadriveError as error:
        with suppress(SafetyError):  # without the state folder the guardians are unknown
            for guardian in waiting_guardians():
                error.add_note(guardian)
        raise
