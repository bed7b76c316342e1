"""The guardians of earlier runs that still wait for their device."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress

from smadrive.devices.guardian.duty import waiting_duties
from smadrive.errors import SafetyError, SmadriveError


def waiting_guardians() -> list[str]:
    """A sentence for each guardian that waits, with its cure. SafetyError when the state folder cannot be read."""
    return [str(duty) for duty in waiting_duties()]


@contextmanager
def notes_waiting_guardians() -> Iterator[None]:
    """An error of the block gets a note for each guardian: one of them may wait for the device that is missing."""
    try:
        yield
    except SmadriveError as error:
        with suppress(SafetyError):  # without the state folder the guardians are unknown
            for guardian in waiting_guardians():
                error.add_note(guardian)
        raise
