"""The guardians of earlier runs that still wait for their device, as `probe` and `off` show them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress

from smadrive.devices.guardian.duty import waiting_duties
from smadrive.errors import SafetyError, SmadriveError


def waiting_guardians() -> list[str]:
    """A sentence for each guardian, with what remains to be done. SafetyError when the state folder cannot be read."""
    return [str(duty) for duty in waiting_duties()]


@contextmanager
def names_waiting_guardians() -> Iterator[None]:
    """An error of the block names them too: their device may be the one that was not found."""
    try:
        yield
    except SmadriveError as error:
        with suppress(SafetyError):  # without the state folder nothing is known of guardians
            for guardian in waiting_guardians():
                error.add_note(guardian)
        raise
