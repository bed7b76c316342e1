"""The emergency stop of a rig: a request of `smadrive off` ends the block at zero current, with an error of its own."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from smadrive.devices.stopping.listener import StopListener
from smadrive.errors import StoppedError
from smadrive.safety.shutdown import carry, shutdown_of


@contextmanager
def stops_on_request(where: str) -> Iterator[StopListener]:
    """Yield the listener of the rig called `where`. An interruption that it has caused becomes a StoppedError.

    The error carries the outcome of the switching off that the interruption carries.
    """
    listener = StopListener()
    try:
        with listener:
            yield listener
    except (KeyboardInterrupt, SystemExit) as interruption:
        if not listener.requested:
            raise
        stopped = StoppedError("stopped by `smadrive off`", where=where)
        if (outcome := shutdown_of(interruption)) is not None:
            carry(stopped, outcome)
        raise stopped from interruption
