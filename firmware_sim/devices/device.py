"""A simulated device: its firmware, its registers, its bus. A `Line` connects one or several devices."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import nan
from typing import Protocol

from firmware_sim.bus.faults import BusFaults, Delivery
from firmware_sim.bus.message import Message, ModbusMessage
from firmware_sim.bus.ports import Port, RawPort, RtuPort, TcpPort, TextPort
from firmware_sim.config import SimConfig
from firmware_sim.devices.firmware import DeviceParts
from firmware_sim.fault_parameters import Delay
from smadrive.clock import Clock
from smadrive.devices.profile.profile import Profile
from smadrive.modbus.transports.in_process import InProcessTransport


class DeviceHost(Protocol):
    """The simulation to which a device belongs: a SimulatedBench. It has the time and the event log."""

    config: SimConfig
    time_s: float

    def build_parts(self, profile: Profile, log_event: Callable[[str], None]) -> DeviceParts:
        """Return the firmware of a device of this profile, and the handler of its requests."""
        ...

    def advance_to(self, time_s: float) -> None:
        """Run the simulation until `time_s`."""
        ...

    def log_event(self, text: str) -> None:
        """Record an event at the present time."""
        ...


class SimulatedDevice:
    """One device of `bench`. `faults` are the faults of its bus; `line` leads to this device alone."""

    def __init__(self, bench: DeviceHost, profile: Profile, unit_id: int | None, name: str, seed: int) -> None:
        """Without `unit_id` the device has the unit id in the profile. `seed` seeds the random bytes of bus faults."""
        self.bench = bench
        self.profile = profile
        self.unit_id = profile.unit_id if unit_id is None else unit_id
        self.name = name
        self._is_powered, self._powered_at_s = True, bench.time_s
        self.firmware, self.responder, self._serial_line = bench.build_parts(profile, self._log_event)
        self.faults = BusFaults(lambda: bench.time_s, seed)
        self.line = Line((self,))
        self._boot_s, self._min_gap_s = profile.timing.boot_ms / 1e3, profile.timing.min_gap_ms / 1e3
        self._deaf_until_s, self._heard_s = bench.time_s + self._boot_s, nan

    @property
    def current_a(self) -> float:
        """The current that the device tries to drive through the wire, A; 0 while it has no power."""
        return self.firmware.current_a if self._is_powered else 0.0

    def answer(self, request: Message, time_s: float) -> list[Delivery]:
        """Carry out a request, and return the deliveries of the reply. A broadcast has no reply.

        Like a real device, the simulated device ignores requests while it starts. After each request it also ignores
        requests for the time `min_gap_ms` of its profile, unless the time stands still between them (lockstep time).
        """
        if not self._listens(time_s):
            return []
        self._deaf_until_s, self._heard_s = time_s + self._min_gap_s, time_s
        if request.broadcast:
            self.responder.answer(request.pdu)
            return []
        return self.faults.answer(request, self.responder.answer, time_s)

    @property
    def raw_port(self) -> Port | None:
        """A port for a device that finds the requests in the bytes itself. None if the simulator finds the requests."""
        return None if self._serial_line is None else RawPort(self.exchange)

    def exchange(self, data: bytes, time_s: float) -> list[Delivery]:
        """Pass `data` to the serial line of the device, and return the deliveries of its replies.

        Return no delivery while the device starts, or if it has no serial line of its own.
        """
        if self._serial_line is None or not self._listens(time_s):
            return []
        deliveries = []
        for due_s, frame in self._serial_line.exchange(data):
            reply = ModbusMessage(frame[0], frame[1:-2])
            deliveries += self.faults.answer(reply, _same, max(due_s, time_s))
        return deliveries

    def transport(self, clock: Clock | None = None) -> InProcessTransport:
        """Return a connection to this device alone, in this process. `clock` is described at `Line.transport`."""
        return self.line.transport(clock)

    def power_cycle(self) -> None:
        """The device loses its power for a moment and restarts.

        The wire is not reset; it cools, because the device drives no current.
        """
        self.brown_out(0.0)

    def brown_out(self, for_s: Delay) -> None:
        """The device has no power for `for_s`: no current flows, and it sends no reply. Then the device boots."""
        if for_s:
            self._log_event(f"no power for {for_s:g} s")
        self._is_powered = False
        self._powered_at_s = max(self._powered_at_s, self.bench.time_s + for_s)
        self._deaf_until_s, self._heard_s = self._powered_at_s + self._boot_s, nan
        self._power_up()

    def tick(self, dt_s: float) -> None:
        """Run the firmware for `dt_s`, also without power: its program has no effect then, and a restart ends it."""
        self.firmware.tick(dt_s)
        if not self._is_powered:
            self._power_up()

    def _power_up(self) -> None:
        """Restart the firmware if the time without power is over."""
        if self.bench.time_s >= self._powered_at_s - 1e-9:
            self._is_powered = True
            self._log_event("power-up")
            self.firmware.restart()

    def _listens(self, time_s: float) -> bool:
        return time_s == self._heard_s or time_s >= self._deaf_until_s - 1e-9

    def _log_event(self, text: str) -> None:
        """Record an event of the device, which has no events while it has no power."""
        if not self._is_powered:
            return
        self.bench.log_event(f"{self.name}: {text}" if self.name else text)


def _same(pdu: bytes) -> bytes:
    return pdu


class Line:
    """A line with one or several devices on it. All of them receive every request."""

    def __init__(self, devices: Sequence[SimulatedDevice]) -> None:
        self.devices = tuple(devices)
        self._bench = devices[0].bench
        self._profile = devices[0].profile
        self.port = self.new_port(numbered=self._profile.profile.protocol == "modbus-tcp")

    def new_port(self, *, numbered: bool) -> Port:
        """Return a new port to the same devices.

        If the device has no registers, the port takes lines of text. Otherwise the port takes Modbus TCP frames with
        `numbered`, and RTU frames without it. A port without `numbered` to a single device is the `raw_port` of this
        device, if the device has one.
        """
        if not self._profile.has_registers:
            return TextPort(self.devices[0].answer)
        if len(self.devices) == 1 and not numbered and (port := self.devices[0].raw_port):
            return port
        return TcpPort(self.devices) if numbered else RtuPort(self.devices)

    def receive(self, data: bytes, time_s: float) -> list[Delivery]:
        """Return the deliveries (time of arrival, bytes) that answer `data`, which arrives at `time_s`."""
        self._bench.advance_to(time_s)
        return self.port.receive(data, time_s)

    def transport(self, clock: Clock | None = None) -> InProcessTransport:
        """Return a connection in this process. It waits on `clock`; without `clock`, waiting advances the bench."""
        line = self._profile.serial_settings()
        transport = InProcessTransport(self, clock or BenchClock(self._bench), None if line is None else line.baudrate)
        for device in self.devices:
            device.faults.connect(transport, numbered=line is None)
        return transport


class BenchClock:
    """A clock that shows the time of the bench. Sleeping advances the bench."""

    def __init__(self, bench: DeviceHost) -> None:
        self._bench = bench

    def now_s(self) -> float:
        """Return the time of the bench."""
        return self._bench.time_s

    def sleep_until(self, time_s: float) -> None:
        """Run the bench until `time_s`."""
        self._bench.advance_to(time_s)
