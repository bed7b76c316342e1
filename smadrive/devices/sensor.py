"""A measuring device beside the heater: read at its own rate, by its own bus, each reading with its time.

A reading that fails is no news: the last one grows older. Once it is older than `stale_s` it is no value any more.
That holds for every failure of the sensor, an exception reply too: it must not discard what the heater has answered.
"""

from __future__ import annotations

from math import inf, nan

from smadrive.clock import Clock
from smadrive.devices.device import Device
from smadrive.devices.heating.heat_source import Sample
from smadrive.errors import DeviceError, ProtocolError, SmadriveError, TransportError


class PolledSensor:
    """The role `quantity` (temperature or displacement) of `device`, read at most every `period_s`."""

    def __init__(self, device: Device, quantity: str, period_s: float, stale_s: float, clock: Clock) -> None:
        """ConfigError when the profile binds no register to `quantity`."""
        self._device = device
        self._quantity = quantity
        self._name = device.profile.role(quantity)
        self.period_s = period_s
        self._stale_s = stale_s
        self._clock = clock
        self._due_s = -inf
        self._last = Sample(nan, -inf, f"no {quantity} has been read yet")
        self._failure: SmadriveError | None = None

    def connect(self) -> None:
        """Prove the device's identity; one that could heat by itself (a controller) is brought to its safe state."""
        self._device.check_identity()
        self._device.enter_safe_state()

    def sample(self) -> Sample:
        """The latest reading, taken now when it is due."""
        now_s = self._clock.now_s()
        if now_s >= self._due_s:
            self._due_s = max(self._due_s, now_s - self.period_s) + self.period_s
            self._poll()
        age_s = self._clock.now_s() - self._last.time_s
        if age_s > self._stale_s and self._last.problem is None:
            return Sample(nan, self._last.time_s, f"no new {self._quantity} for {age_s:.2f} s ({self._failure})")
        return self._last

    def _poll(self) -> None:
        try:
            reading = self._device.read((self._name,))[self._name]
        except (TransportError, ProtocolError, DeviceError) as failure:
            self._failure = failure
            return
        self._last = Sample(reading.value, self._clock.now_s(), reading.invalid)
