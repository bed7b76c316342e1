"""Publishes a run of a command: every tick as a row, and a status with limits, faults and the end."""

from __future__ import annotations

import time
from types import TracebackType
from typing import Self

from smadrive.control.loop import Tick
from smadrive.errors import SmadriveError, StoppedError
from smadrive.rig.config import RigConfig
from smadrive.rig.rig import Rig
from smadrive.safety.shutdown import shutdown_of
from smadrive.stream.feed import TickFeed
from smadrive.stream.published_state import PublishedEnd, PublishedMode
from smadrive.stream.shared_memory import SharedWriter


class RunFeed(TickFeed):
    """Writes ticks and status of a run to shared memory. A context manager.

    `mode` is the published mode while ticks arrive. The rig must be opened and closed within the context: at its end
    the status says whether the heater is confirmed off. If the rig cannot be opened, nothing is published.
    """

    def __init__(self, writer: SharedWriter, config: RigConfig, mode: PublishedMode) -> None:
        nothing = dict.fromkeys(("began_unix_s", "end", "fault", "fault_type", "latched"))
        super().__init__(writer, config, {}, mode=PublishedMode.OFF, **nothing)
        self._running_mode = mode
        self._rig: Rig | None = None

    def __enter__(self) -> Self:
        """Return this feed. Nothing is published before `begin`: until then another program may drive the rig."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Publish the end, the SmadriveError that has ended the run, if any, and the latched trip.

        Without `begin`, publish nothing. A SmadriveError that `off` has overtaken is the cause of a StoppedError.
        """
        if self._rig is None:
            return
        outcome = None if error is None else shutdown_of(error)
        confirmed = outcome is None or outcome.confirmed
        ended_by = error.__cause__ if isinstance(error, StoppedError) else error
        fault = ended_by if isinstance(ended_by, SmadriveError) else None
        self._publish(
            mode=PublishedMode.switched_off(confirmed=confirmed),
            end=PublishedEnd.switched_off(confirmed=confirmed),
            fault=None if fault is None else str(fault),
            fault_type=None if fault is None else type(fault).__name__,
            latched=self._rig.latch.read(),
            limited_by=[],  # there is no output any more that a limit could hold back
        )

    def begin(self, rig: Rig) -> None:
        """Publish the first status, with the devices and the latched trip of the rig that was opened."""
        self._rig, self._identities = rig, rig.identities
        self._publish(latched=rig.latch.read())

    def tick(self, tick: Tick) -> None:
        """Write a tick. At the first tick, publish `mode`, and the Unix time at which `time_s` is 0."""
        if self._began_s is None:
            self._publish(began_unix_s=time.time() - tick.time_s, mode=self._running_mode)
        super().tick(tick)
