"""A simulated device on a bench: what it does, its registers, its bus."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

from firmware_sim.bus.faults import BusFaults, Delivery, Later
from firmware_sim.bus.message import Message
from firmware_sim.bus.ports import Port, RtuPort, TcpPort, TextPort
from firmware_sim.config import SimConfig
from firmware_sim.devices.behaviour import Inside
from smadrive.clock import Clock
from smadrive.devices.profile.profile import Profile
from smadrive.modbus.transports.in_process import InProcessTransport


class Bench(Protocol):
    """What a device needs of the bench it stands on."""

    config: SimConfig
    time_s: float

    def inside(self, profile: Profile, tell: Callable[[str], None]) -> Inside:
        """What makes a device of this profile go, and who answers for it."""
        ...

    def advance_to(self, time_s: float) -> None:
        """Let the time reach `time_s`."""
        ...

    def tell(self, text: str) -> None:
        """An event, now."""
        ...


class SimulatedDevice:
    """One device of `bench`; `faults` are those of its bus, `line` is one of its own."""

    def __init__(self, bench: Bench, profile: Profile, unit_id: int | None, name: str, seed: int) -> None:
        self.bench = bench
        self.profile = profile
        self.unit_id = profile.unit_id if unit_id is None else unit_id
        self.name = name
        self.firmware, self.responder = bench.inside(profile, self._tell)
        self.faults = BusFaults(lambda: bench.time_s, seed)
        self.line = Line((self,))
        self._boot_s, self._min_gap_s = profile.timing.boot_ms / 1e3, profile.timing.min_gap_ms / 1e3
        self._deaf_until_s = bench.time_s + self._boot_s

    def answer(self, request: Message, time_s: float) -> list[Delivery]:
        """Carry out a request, and answer unless it was a broadcast.

        Like the real one, the device hears nothing while it starts, nor in the pause that it needs between frames.
        """
        if time_s < self._deaf_until_s - 1e-9:
            return []
        self._deaf_until_s = time_s + self._min_gap_s
        if request.broadcast:
            self.responder.answer(request.pdu)
            return []
        return self.faults.answer(request, self.responder.answer, time_s)

    def transport(self, clock: Clock | None = None) -> InProcessTransport:
        """A connection to this device alone, in this process; see Line."""
        return self.line.transport(clock)

    def power_cycle(self) -> None:
        """The supply fails and returns: the firmware starts anew, the wire goes on cooling."""
        self.brown_out(0.0)

    def brown_out(self, for_s: Later) -> None:
        """The mains fail for a while: nothing drives current, nothing answers, until the device has started anew."""
        self._tell(f"no power for {for_s:g} s" if for_s else "power-up")
        self.firmware.restart()
        self._deaf_until_s = self.bench.time_s + for_s + self._boot_s

    def _tell(self, text: str) -> None:
        self.bench.tell(f"{self.name}: {text}" if self.name else text)


class Line:
    """A line with one or several devices on it, all of which hear every request."""

    def __init__(self, devices: Sequence[SimulatedDevice]) -> None:
        self.devices = tuple(devices)
        self._bench = devices[0].bench
        self._profile = devices[0].profile
        self.port = self.new_port(numbered=self._profile.profile.protocol == "modbus-tcp")

    def new_port(self, *, numbered: bool) -> Port:
        """Another way in: by Modbus TCP frames, which are numbered, by RTU frames, or by text where it speaks that."""
        if not self._profile.has_registers:
            return TextPort(self.devices[0].answer)
        return TcpPort(self.devices) if numbered else RtuPort(self.devices)

    def receive(self, data: bytes, time_s: float) -> list[Delivery]:
        """Bytes that arrive at `time_s`: what is answered, and when it arrives."""
        self._bench.advance_to(time_s)
        return self.port.receive(data, time_s)

    def transport(self, clock: Clock | None = None) -> InProcessTransport:
        """A connection in this process, on `clock`; by default on the bench's own time, which waiting moves on."""
        line = self._profile.serial_settings()
        transport = InProcessTransport(self, clock or BenchClock(self._bench), None if line is None else line.baudrate)
        for device in self.devices:
            device.faults.connect(transport, numbered=line is None)
        return transport


class BenchClock:
    """The bench's own time as a clock."""

    def __init__(self, bench: Bench) -> None:
        self._bench = bench

    def now_s(self) -> float:
        """The bench's time."""
        return self._bench.time_s

    def sleep_until(self, time_s: float) -> None:
        """Let the bench live until then."""
        self._bench.advance_to(time_s)
