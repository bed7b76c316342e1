"""The simulated rig in one piece: wire, sensors, firmware, registers, bus.

It lives on the time it is told: `advance_to` moves everything on in ticks of 10 ms. The same config, seed and calls
give the same rig, to the last bit, at any speed.
"""

from __future__ import annotations

from collections.abc import Callable

from firmware_sim.behaviour import Behaviour
from firmware_sim.chance import ChanceFaults
from firmware_sim.config import SimConfig
from firmware_sim.faults import BusFaults, Delivery
from firmware_sim.firmware import Firmware
from firmware_sim.instrument import Instrument
from firmware_sim.message import Message
from firmware_sim.plant import Plant
from firmware_sim.ports import Port, RtuPort, TcpPort
from firmware_sim.registers import RegisterBank
from firmware_sim.responder import Responder
from firmware_sim.sensors import Sensors
from firmware_sim.supply import Supply
from firmware_sim.timeline import FaultScript, Timeline, bound
from smadrive.clock import Clock
from smadrive.device.profile import Profile, load_profile
from smadrive.modbus import frames
from smadrive.modbus.inprocess import InProcessTransport

TICK_S = 0.01
FIRMWARE_VERSION = 100


class SimulatedDevice:
    """A board with a wire on it. What goes wrong is a method: of `faults` (the bus), `sensors` and `plant`."""

    def __init__(
        self, config: SimConfig, profile: Profile, seed: int, log: Callable[[str], None] | None = None
    ) -> None:
        """`log` gets a line per event, with the device's time."""
        self.time_s = 0.0
        self.profile = profile
        self.events: list[str] = []
        self._log = log
        self.plant = Plant(config.wire, config.transformation)
        self.sensors = Sensors(config, self.plant, seed)
        self.firmware = self._behaviour(config)
        self.faults = BusFaults(lambda: self.time_s, seed)
        self._seed = seed
        self._timeline = Timeline()
        bank = RegisterBank(profile)
        bank.preset("serial_number", config.board.serial_number)
        bank.preset("firmware_version", FIRMWARE_VERSION)
        self.responder = Responder(bank, self.firmware, profile.timing)
        self.port = self.new_port(numbered=profile.profile.protocol == "modbus-tcp")
        self._deaf_until_s = profile.timing.boot_ms / 1e3

    @classmethod
    def from_config(
        cls,
        config: SimConfig,
        seed: int = 0,
        profile: Profile | None = None,
        log: Callable[[str], None] | None = None,
    ) -> SimulatedDevice:
        """The rig of `config`, speaking the map of `profile` (the reference one by default)."""
        return cls(config, profile or load_profile("sma-reference"), seed, log)

    def advance_to(self, time_s: float) -> None:
        """Let the device's time reach `time_s`; nothing happens if it is past."""
        while (remaining_s := time_s - self.time_s) > 1e-9:
            self._tick(min(TICK_S, remaining_s))

    @property
    def unit_id(self) -> int:
        """What it answers to."""
        return self.profile.unit_id

    def new_port(self, *, numbered: bool) -> Port:
        """Another way in: by Modbus TCP frames, which are numbered, or by RTU frames."""
        return TcpPort((self,)) if numbered else RtuPort((self,))

    def receive(self, data: bytes, time_s: float, port: Port | None = None) -> list[Delivery]:
        """Bytes that reach `port` at `time_s`: what is answered, and when it arrives."""
        self.advance_to(time_s)
        return (port or self.port).receive(data, time_s)

    def answer(self, request: Message, time_s: float) -> list[Delivery]:
        """Carry out a request, and answer unless it was a broadcast.

        Like the real one, the device hears nothing while it starts, nor in the pause that it needs between frames.
        """
        if time_s < self._deaf_until_s - 1e-9:
            return []
        self._deaf_until_s = time_s + self.profile.timing.min_gap_ms / 1e3
        if request.unit_id == frames.BROADCAST and request.number is None:
            self.responder.answer(request.pdu)
            return []
        return self.faults.answer(request, self.responder.answer, time_s)

    def overhear(self) -> None:
        """A request for another passes by."""
        self.responder.counters.for_others += 1

    def transport(self, clock: Clock | None = None) -> InProcessTransport:
        """A connection in this process, on `clock`; by default on the device's own time, which waiting moves on."""
        line = self.profile.serial_settings()
        transport = InProcessTransport(self, clock or DeviceClock(self), None if line is None else line.baudrate)
        self.faults.ears.append(transport)
        return transport

    def follow_script(self, script: FaultScript) -> None:
        """From now on let the faults of `script` happen; ConfigError when it names one that there is not."""
        self._timeline = Timeline(bound(script, self.known_faults()), self._event)
        self._timeline.pass_time(self.time_s)
        if script.random is not None:
            chance = script.random
            ChanceFaults(self.faults, self.power_cycle, chance.share, chance.slowest_s, self._seed)

    def known_faults(self) -> dict[str, Callable[..., None]]:
        """Everything that a script can do to the rig."""
        sensors, plant = self.sensors, self.plant
        physical = (
            *(sensors.open_thermocouple, sensors.short_thermocouple, sensors.freeze_thermocouple),
            *(sensors.stop_conversions, sensors.mend_thermocouple, plant.break_wire, plant.short_switch),
        )
        named = {fault.__name__: fault for fault in physical}
        return {**self.faults.by_name(), **named, "reboot": self.power_cycle, "mend_heater": plant.mend}

    def power_cycle(self) -> None:
        """The supply fails and returns: the firmware starts anew, the wire goes on cooling."""
        self._event("power-up")
        self.firmware.restart()
        self._deaf_until_s = self.time_s + self.profile.timing.boot_ms / 1e3

    def switch_off(self) -> None:
        """The simulation ends, and with it the heating."""
        self.firmware.restart()
        self._event("heater off, end")

    def _behaviour(self, config: SimConfig) -> Behaviour:
        match self.profile.profile.role:
            case "heater":
                return Firmware(config.board, self.sensors, self._event)
            case "supply":
                has_voltage = self.profile.roles.heater_voltage is not None
                return Supply(self.sensors, has_voltage=has_voltage, log=self._event)
            case _:
                return Instrument(self.sensors, self.profile.timing.update_ms / 1e3)

    def _tick(self, dt_s: float) -> None:
        before_c = self.plant.temperature_c
        self.plant.advance(self.firmware.current_a, dt_s, self.firmware.voltage_max_v)
        self.sensors.advance(before_c, dt_s)
        self.time_s += dt_s
        self.firmware.tick(dt_s)
        self._timeline.pass_time(self.time_s)

    def _event(self, text: str) -> None:
        line = f"t={self.time_s:.3f} s {text}"
        self.events.append(line)
        if self._log is not None:
            self._log(line)


class DeviceClock:
    """The device's own time as a clock."""

    def __init__(self, device: SimulatedDevice) -> None:
        self._device = device

    def now_s(self) -> float:
        """The device's time."""
        return self._device.time_s

    def sleep_until(self, time_s: float) -> None:
        """Let the device live until then."""
        self._device.advance_to(time_s)
