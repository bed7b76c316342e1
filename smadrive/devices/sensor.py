"""A sensor on a device of its own, besides the heat source. It has its own period, and each reading has its own time.

If the sensor does not answer, or answers with an error, the previous reading is used until it is older than `stale_s`.
Then the value is invalid. A failure of the sensor raises no error, so the measurement of the heat source is not lost.

The loop waits for each missing reply. While the source heats, it waits for little else: no reading awaits the end of
noise on the line, and a sensor that has failed for longer than `stale_s` is read less often. So the loop keeps its
rate, and another source can replace the value.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, nan

from smadrive.clock import Clock
from smadrive.devices.device import Device
from smadrive.devices.heating.heat_source import Sample
from smadrive.errors import DeviceError, ProtocolError, SmadriveError, TransportError
from smadrive.modbus.bus_line import REOPENS_WITHIN_S

FAILED_PAUSE = 20.0
"""Longest pause of a sensor that has failed for longer than `stale_s`, in multiples of the time of its last failure."""


class PolledSensor:
    """Reads the role `quantity` (temperature or displacement) of `device`, at most once per `period_s`."""

    def __init__(
        self,
        device: Device,
        quantity: str,
        period_s: float,
        stale_s: float,
        clock: Clock,
        neighbours: Sequence[Device] = (),
    ) -> None:
        """`neighbours` are the other devices on its line. ConfigError if the profile has no register for `quantity`."""
        self._device = device
        self._neighbours = neighbours
        self.quantity = quantity
        self._name = device.profile.role(quantity)
        self.period_s = period_s
        self._stale_s = stale_s
        self._clock = clock
        # After a failure, the line must be silent for a response timeout. A displacement sensor on a line of its own
        # does not wait for that: the time passes between two readings. A thermometer waits, because the run ends if it
        # fails for long. A sensor on a shared line waits, too: other devices could break the silence each time.
        self._within_s = _attempt_s(device) * (2.0 if quantity == "temperature" or neighbours else 1.0)
        self._due_s = self._resumes_s = -inf
        self._last = Sample(nan, -inf, f"no {quantity} has been read yet")
        self._failure: SmadriveError | None = None
        self._failing_since_s = inf

    @property
    def delay_s(self) -> float:
        """The longest time by which the sensor delays a tick of the loop when it falls silent, s.

        On a line of its own, that is a missed deadline, and the time in which a lost connection is opened again. On a
        shared line, the next request must also wait until the line has been silent.
        """
        reopening_s = REOPENS_WITHIN_S if self._device.client.transport.reconnects else 0.0
        silence_s = max(map(_attempt_s, (self._device, *self._neighbours))) if self._neighbours else 0.0
        return _attempt_s(self._device) + reopening_s + silence_s

    @property
    def failure(self) -> SmadriveError | None:
        """The error since which every attempt to read the sensor has failed; None if the last attempt succeeded."""
        return self._failure

    def connect(self) -> None:
        """Prove the identity of the device, then write its safe state, because a temperature controller could heat."""
        self._device.check_identity()
        self._device.enter_safe_state()

    def sample(self, *, heats: bool) -> Sample:
        """Return the latest sample. If the period has passed, read the device first. `heats`: the source is armed.

        The value is NaN, with the reason, if the latest sample is older than `stale_s`.
        """
        now_s = self._clock.now_s()
        if now_s >= (max(self._due_s, self._resumes_s) if heats else self._due_s):
            self._due_s = max(self._due_s, now_s - self.period_s) + self.period_s
            self._poll(now_s, self._within_s if heats else inf)
        age_s = self._clock.now_s() - self._last.time_s
        if age_s > self._stale_s and self._last.problem is None:
            return Sample(nan, self._last.time_s, f"no new {self.quantity} for {age_s:.2f} s ({self._failure})")
        return self._last

    def _poll(self, now_s: float, within_s: float) -> None:
        try:
            reading = self._device.read((self._name,), within_s=within_s)[self._name]
        except (TransportError, ProtocolError, DeviceError) as error:
            self._failure = self._failure or error  # later errors are those of a line that must become silent first
            self._failing_since_s = min(self._failing_since_s, now_s)
            self._pause(now_s, self._clock.now_s())
            return
        self._failure, self._failing_since_s = None, inf
        self._last = Sample(reading.value, self._clock.now_s(), reading.invalid)

    def _pause(self, asked_s: float, failed_s: float) -> None:
        """Leave a sensor that has failed for longer than `stale_s` alone for half of this time."""
        failing_s = failed_s - self._failing_since_s
        if failing_s > self._stale_s:
            self._resumes_s = failed_s + min(0.5 * failing_s, FAILED_PAUSE * (failed_s - asked_s))


def _attempt_s(device: Device) -> float:
    return device.client.attempt_s(device.profile.bus_timing())
