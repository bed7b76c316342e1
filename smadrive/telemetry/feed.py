"""Publishes a run of a command: every tick as a row, and a status with limits, faults and the end."""

from __future__ import annotations

import time
from math import inf
from types import TracebackType
from typing import Any, Self

from smadrive.control.loop import Tick
from smadrive.errors import SmadriveError
from smadrive.measurement import Measurement
from smadrive.rig.config import RigConfig
from smadrive.rig.rig import Rig
from smadrive.safety.shutdown import shutdown_of
from smadrive.stream.samples import row_of
from smadrive.stream.shared_memory import SharedWriter

STATUS_S = 0.2
"""The status is published with this period."""

OFF, UNCONFIRMED = "off", "off, unconfirmed"
"""The `mode` without heat, and after a failure to switch off."""


class RunFeed:
    """Writes ticks and status of a run to shared memory; a context manager around the rig.

    `heating` is the `mode` while ticks arrive. When the context ends, the rig is closed, and the status tells whether
    the heater is confirmed off.
    """

    def __init__(self, writer: SharedWriter, config: RigConfig, heating: str) -> None:
        self._writer = writer
        self._heating = heating
        self._began_s: float | None = None
        self._published_s = -inf
        self._measurement: Measurement | None = None
        limits = config.limits
        self._status: dict[str, Any] = {
            "rig": config.name,
            "rate_hz": config.rate_hz,
            "limits": {"current_max_a": limits.current_max_a, "temperature_max_c": limits.temperature_max_c},
            "devices": {},
            "began_unix_s": None,
            "mode": OFF,
            "end": None,
            "limited_by": [],
            "fault": None,
            "fault_type": None,
            "device_faults": [],
            "temperature_fault": None,
        }

    def __enter__(self) -> Self:
        """Publish the first status."""
        self._publish()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Publish the end, the last faults, and the error of smadrive that has ended the run."""
        outcome = None if error is None else shutdown_of(error)
        is_off = outcome is None or outcome.confirmed
        fault = error if isinstance(error, SmadriveError) else None
        self._publish(
            **_state_of(self._measurement),
            mode=OFF if is_off else UNCONFIRMED,
            end="off" if is_off else "unconfirmed",
            fault=None if fault is None else str(fault),
            fault_type=None if fault is None else type(fault).__name__,
        )

    def begin(self, rig: Rig) -> None:
        """Publish the devices of the rig that was opened."""
        self._publish(devices={name: str(identity) for name, identity in rig.identities.items()})

    def tick(self, tick: Tick) -> None:
        """Write a tick, and every `STATUS_S` the status."""
        if self._began_s is None:
            self._began_s = tick.measurement.time_s - tick.time_s
            self._publish(began_unix_s=time.time() - tick.time_s, mode=self._heating)
        self._writer.append(row_of(tick, self._began_s))
        self._measurement = tick.measurement
        if tick.time_s - self._published_s >= STATUS_S:
            self._published_s = tick.time_s
            self._publish(**_state_of(tick.measurement))

    def _publish(self, **changes: Any) -> None:
        self._status.update(changes)
        self._writer.publish(self._status)


def _state_of(measurement: Measurement | None) -> dict[str, Any]:
    if measurement is None:
        return {}
    return {
        "limited_by": list(measurement.limits),
        "device_faults": list(measurement.device_faults),
        "temperature_fault": measurement.temperature_fault,
    }
