"""The common part of every published status, and the feed: it writes the ticks and the status of a command."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import Any

from smadrive.control.loop import Tick
from smadrive.measurement import Measurement
from smadrive.rig.config import RigConfig
from smadrive.rig.supervision import unexpected_current
from smadrive.stream.published_state import PublishedMode
from smadrive.stream.samples import row_of
from smadrive.stream.shared_memory import SharedWriter

STATUS_S = 0.2
"""The status is published with this period."""


def common_status(
    config: RigConfig, identities: Mapping[str, object], measurement: Measurement | None, mode: PublishedMode
) -> dict[str, Any]:
    """Return the fields that every status has: rig, rate, limits, devices, mode, active limits, and faults.

    `identities` has the type of each device by its name. `measurement` is the last measurement; it is None before the
    first tick. `unexpected_current` is a warning of a current that flows although the heater is off; otherwise None.
    """
    is_off = mode is PublishedMode.OFF
    return {
        "rig": config.name,
        "rate_hz": config.rate_hz,
        "limits": {
            "current_max_a": config.limits.current_max_a,
            "temperature_max_c": config.limits.temperature_max_c,
        },
        "devices": {name: str(identity) for name, identity in identities.items()},
        "mode": mode,
        "limited_by": [] if measurement is None else list(measurement.limits),
        "device_faults": [] if measurement is None else list(measurement.device_faults),
        "temperature_fault": None if measurement is None else measurement.temperature_fault,
        "supply_fault": None if measurement is None else measurement.supply_fault,
        "unexpected_current": unexpected_current(config, measurement) if is_off and measurement is not None else None,
    }


class TickFeed:
    """Writes each tick as a row to `writer`, and every `STATUS_S` a status.

    The status has the fields of `common_status`, and the fields `own`, with which a subclass extends it. One of `own`
    is the `mode`.
    """

    def __init__(self, writer: SharedWriter, config: RigConfig, identities: Mapping[str, object], **own: Any) -> None:
        self._writer = writer
        self._config = config
        self._identities = identities
        self._own = own
        self._began_s: float | None = None
        self._published_s = -inf
        self._measurement: Measurement | None = None

    def tick(self, tick: Tick) -> None:
        """Write a tick, and every `STATUS_S` the status."""
        if self._began_s is None:
            self._began_s = tick.measurement.time_s - tick.time_s
        self._writer.append(row_of(tick, self._began_s))
        self._measurement = tick.measurement
        if tick.time_s - self._published_s >= STATUS_S:
            self._published_s = tick.time_s
            self._publish()

    def _publish(self, **changes: Any) -> None:
        """Change some of the fields `own`, then publish the status."""
        self._own.update(changes)
        common = common_status(self._config, self._identities, self._measurement, self._own["mode"])
        self._writer.publish({**common, **self._own})
