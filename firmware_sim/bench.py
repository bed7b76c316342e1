"""A simulated bench: one wire with its sensors, and the devices on it, all on one clock.

    bench = SimulatedBench(load_sim("flexinol-lt-0.15mm"), seed=1)
    supply = bench.attach(load_profile("riden-rd60xx"), name="supply")      # one device heats
    reader = bench.attach(load_profile("delta-dtb"), name="reader")         # other devices measure
    supply.transport(clock), reader.transport(clock)                        # each device on a line of its own
    Line((supply, reader)).transport(clock)                                 # or several devices on one line

The caller moves time: `advance_to` runs the bench in ticks of 10 ms. The same config, seed and calls give the same
results, to the last bit, at any speed. Only the serial number of a device is random at every start, unless the config
gives one. The driver distinguishes devices by their serial numbers.

A fault is a method of one of these objects: `device`, `device.faults` (faults of the bus), `sensors.faults`,
`sensors.bead`, `plant.faults` (heater circuit), `plant.surroundings`, `plant.load` and `plant.ageing`.
"""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt
from random import SystemRandom

from firmware_sim.board.emulator.firmware import EmulatedFirmware
from firmware_sim.board.native_board import NativeBoard
from firmware_sim.bus.random_faults import RandomBusFaults
from firmware_sim.config import Implementation, SimConfig
from firmware_sim.devices.board.firmware import BoardFirmware
from firmware_sim.devices.device import SimulatedDevice
from firmware_sim.devices.firmware import DeviceParts, RegisterFirmware
from firmware_sim.devices.instrument import InstrumentFirmware
from firmware_sim.devices.registers import RegisterBank
from firmware_sim.devices.responder import Responder
from firmware_sim.devices.supply import SupplyFirmware
from firmware_sim.devices.tclab import PULSE_FACTORY, PULSE_MAX, TCLabFirmware
from firmware_sim.fault_script import FaultScript, Timeline, scheduled
from firmware_sim.physics.plant import Plant
from firmware_sim.sensors.sensors import Sensors
from smadrive.devices.profile.profile import Profile, load_profile
from smadrive.errors import ConfigError

TICK_S = 0.01
FIRMWARE_VERSION = 100
SERIAL_NUMBERS = range(1 << 31, (1 << 32) - 1)
"""Random serial numbers of simulated devices. Vendors use lower numbers; 0xFFFFFFFF means "no serial number"."""


class SimulatedBench:
    """The wire and its devices. `log` gets a line per event, with the time of the bench; `events` keeps these lines."""

    def __init__(self, config: SimConfig, seed: int = 0, log: Callable[[str], None] | None = None) -> None:
        self.config = config
        self.seed = seed
        self.time_s = 0.0
        self.events: list[str] = []
        self.plant = Plant(config)
        self.sensors = Sensors(config, self.plant, seed)
        self.devices: list[SimulatedDevice] = []
        self._heating: SimulatedDevice | None = None
        self._log = log
        self._timeline = Timeline()

    def attach(self, profile: Profile, unit_id: int | None = None, name: str = "") -> SimulatedDevice:
        """Add a device with the register map of `profile`. The names of its events and faults begin with `name`.

        Without `unit_id` the device has the unit id in the profile. ConfigError for a second device that heats.
        """
        if profile.profile.heats and self._heating is not None:
            raise ConfigError(
                f"'{profile.profile.id}' and '{self._heating.profile.profile.id}' would both heat the simulated wire",
                where=f"device '{name}'" if name else "",
                cure="attach only one of them",
            )
        device = SimulatedDevice(self, profile, unit_id, name, seed=self.seed + len(self.devices))
        self.devices.append(device)
        if profile.profile.heats:
            self._heating = device
        return device

    def build_parts(self, profile: Profile, log_event: Callable[[str], None]) -> DeviceParts:
        """Return the firmware of a device of this profile, and the handler of its requests."""
        board = self.config.board
        if not profile.has_registers:
            tclab = TCLabFirmware(self.sensors, self._tclab_supply_v(), lambda: self.plant.loop_ohm, log_event)
            return DeviceParts(tclab, tclab)
        serial_number = _random_serial_number() if board.serial_number is None else board.serial_number
        if profile.profile.role == "heater" and board.implementation != Implementation.PYTHON:
            return self._board_in_c(profile, serial_number, log_event)
        firmware = self._register_firmware(profile, log_event)
        bank = RegisterBank(profile)
        bank.preset("serial_number", serial_number)
        bank.preset("firmware_version", FIRMWARE_VERSION)
        return DeviceParts(firmware, Responder(bank, firmware, profile.timing))

    def _tclab_supply_v(self) -> float:
        """Return the supply voltage in V with which Q1 = 100 % drives the current limit through cold wire and leads.

        The pulse width P1 then has its value at power-up.
        """
        cold_ohm = self.config.wire.resistance_cold_ohm + self.config.sense.lead_ohm
        limit_v = self.config.board.supply_limit_a * cold_ohm
        return limit_v / sqrt(PULSE_FACTORY["P1"] / PULSE_MAX)

    def _register_firmware(self, profile: Profile, log_event: Callable[[str], None]) -> RegisterFirmware:
        match profile.profile.role:
            case "heater":
                version = 1 if profile.roles.estop is None else 2
                return BoardFirmware(self.config.board, self.sensors, log_event, version, self.seed)
            case "supply":
                return SupplyFirmware(self.sensors, profile, log_event)
            case _:
                return InstrumentFirmware(self.sensors, profile.timing.update_ms / 1e3)

    def _board_in_c(self, profile: Profile, serial_number: int, log_event: Callable[[str], None]) -> DeviceParts:
        if profile.roles.estop is None:
            raise ConfigError(
                "the board core serves only map version 2",
                where=f"profile '{profile.profile.id}'",
                cure="use the profile sma-reference, or the implementation python",
            )
        if self.config.board.implementation == Implementation.ATMEGA328P:
            emulated = EmulatedFirmware(self.config, self.sensors, log_event, serial_number, self.seed)
            return DeviceParts(emulated, emulated, emulated.line)
        native = NativeBoard(
            self.config.board,
            self.sensors,
            log_event,
            serial_number=serial_number,
            firmware_version=FIRMWARE_VERSION,
            seed=self.seed,
        )
        return DeviceParts(native, native)

    def advance_to(self, time_s: float) -> None:
        """Run the bench until `time_s`. Do nothing for a time in the past."""
        while (remaining_s := time_s - self.time_s) > 1e-9:
            self._tick(min(TICK_S, remaining_s))

    def follow_script(self, script: FaultScript) -> None:
        """Apply the faults of `script` from now on.

        ConfigError for a fault that this bench does not have, and for a wrong parameter of a fault.
        """
        self._timeline = Timeline(scheduled(script, self.known_faults()), self.log_event)
        self._timeline.advance_to(self.time_s)
        if script.random is not None:
            for device in self.devices:
                RandomBusFaults(device.faults, device.power_cycle, seed=self.seed, **script.random.model_dump())

    def known_faults(self) -> dict[str, Callable[..., None]]:
        """Return the methods that a fault script can call, by name.

        For a device with a name, the names of the faults begin with the name of the device and a dot.
        """
        faults = self.sensors.faults.by_name() | self.sensors.bead.by_name() | self.plant.faults_by_name()
        for device in self.devices:
            prefix = f"{device.name}." if device.name else ""
            faults |= {prefix + name: fault for name, fault in device.faults.by_name().items()}
            faults |= {prefix + "reboot": device.power_cycle, prefix + "brown_out": device.brown_out}
        return faults

    def switch_off(self) -> None:
        """End the simulation: every device restarts with its output off."""
        for device in self.devices:
            device.firmware.restart()
        self.log_event("heater off, end")

    def log_event(self, text: str) -> None:
        """Record an event at the present time."""
        line = f"t={self.time_s:.3f} s {text}"
        self.events.append(line)
        if self._log is not None:
            self._log(line)

    def _tick(self, dt_s: float) -> None:
        before_c = self.plant.temperature_c
        if self._heating is None:
            self.plant.advance(0.0, dt_s)
        else:
            self.plant.advance(self._heating.current_a, dt_s, self._heating.firmware.voltage_max_v)
        self.sensors.advance(before_c, dt_s)
        self.time_s += dt_s
        for device in self.devices:
            device.tick(dt_s)
        self._timeline.advance_to(self.time_s)


def _random_serial_number() -> int:
    return SystemRandom().choice(SERIAL_NUMBERS)


def simulated_device(
    config: SimConfig, seed: int = 0, profile: Profile | None = None, log: Callable[[str], None] | None = None
) -> SimulatedDevice:
    """Return the only device of a new bench. Without `profile` the device is the reference board."""
    return SimulatedBench(config, seed, log).attach(profile or load_profile("sma-reference"))
