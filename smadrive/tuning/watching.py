"""The data of the page of `smadrive watch`: every measurement, and a status with faults and the end of the command."""

from __future__ import annotations

from math import inf
from typing import Any

from smadrive.control.loop import Tick
from smadrive.measurement import Measurement
from smadrive.rig.rig import Rig
from smadrive.safety.shutdown import shut_down
from smadrive.stream.samples import row_of
from smadrive.tuning.link.channel import ControlEnd

STATUS_S = 0.2
"""The status is published with this period."""


class WatchFeed:
    """Sends the measurements of a rig, whose heater is off, to the pages through `channel`."""

    def __init__(self, rig: Rig, channel: ControlEnd) -> None:
        self._rig = rig
        self._channel = channel
        self._began_s: float | None = None
        self._published_s = -inf
        limits = rig.config.limits
        self._fixed = {
            "rig": rig.config.name,
            "devices": {name: str(identity) for name, identity in rig.identities.items()},
            "rate_hz": rig.config.rate_hz,
            "limits": {"current_max_a": limits.current_max_a, "temperature_max_c": limits.temperature_max_c},
            "latched": rig.latch.read(),
            "mode": "off",
            "lost": None,
            **dict.fromkeys(("fault", "fault_type", "fault_s")),
        }
        self._publish(None, None)

    def tick(self, tick: Tick) -> None:
        """Send the measurement of a tick to the pages, and every `STATUS_S` also the status."""
        if self._began_s is None:
            self._began_s = tick.measurement.time_s - tick.time_s
        self._channel.append(row_of(tick, self._began_s))
        if tick.time_s - self._published_s >= STATUS_S:
            self._published_s = tick.time_s
            self._publish(tick.measurement, None)

    def off_requested(self) -> bool:
        """Return True if a program has sent `POST /off`. The page itself has no OFF, because nothing heats."""
        return self._channel.off_requested()

    def end(self) -> None:
        """Enter the safe state once more, and report to the pages whether it is confirmed."""
        outcome = shut_down(self._rig.heater.enter_safe_state)
        self._publish(None, "off" if outcome.confirmed else "unconfirmed")

    def _publish(self, measurement: Measurement | None, end: str | None) -> None:
        status: dict[str, Any] = {
            **self._fixed,
            "device_faults": [] if measurement is None else measurement.device_faults,
            "temperature_fault": None if measurement is None else measurement.temperature_fault,
            "end": end,
        }
        self._channel.publish(status)
