"""A simulated bench: one wire with its sensors, and the devices on it, in one time.

    bench = SimulatedBench(load_sim("flexinol-lt-0.15mm"), seed=1)
    supply = bench.attach(load_profile("riden-rd60xx"), name="supply")      # one device heats
    reader = bench.attach(load_profile("delta-dtb"), name="reader")         # any number measures
    supply.transport(clock), reader.transport(clock)                        # each on a line of its own
    Line((supply, reader)).transport(clock)                                 # or several on one line

The bench lives on the time it is told: `advance_to` moves everything on in ticks of 10 ms. The same config, seed and
calls give the same bench, to the last bit, at any speed. Only the serial number of a device is drawn anew every time,
unless the config gives it, so that no simulated device passes for another one or for a real one. What goes wrong is a
method: of a device's `faults` (its bus), of `sensors.faults` and of `plant.faults`.
"""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt
from random import SystemRandom

from firmware_sim.bus.random_faults import RandomBusFaults
from firmware_sim.config import SimConfig
from firmware_sim.devices.behaviour import Inside, RegisterBehaviour
from firmware_sim.devices.board import Firmware
from firmware_sim.devices.device import SimulatedDevice
from firmware_sim.devices.instrument import Instrument
from firmware_sim.devices.registers import RegisterBank
from firmware_sim.devices.responder import Responder
from firmware_sim.devices.supply import Supply
from firmware_sim.devices.tclab import PULSE_FACTORY, PULSE_MAX, TCLabFirmware
from firmware_sim.fault_script import FaultScript, Timeline, bound
from firmware_sim.physics.plant import Plant
from firmware_sim.sensors.sensors import Sensors
from smadrive.devices.profile.profile import Profile, load_profile
from smadrive.errors import ConfigError

TICK_S = 0.01
FIRMWARE_VERSION = 100
SERIAL_NUMBERS = range(1 << 31, (1 << 32) - 1)
"""Of simulated devices: vendors count from the low end, and the highest number means that there is none."""


class SimulatedBench:
    """The wire and its devices. `log` gets a line per event, with the time of the bench; `events` keeps them."""

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
        """A device with the map of `profile`; `name` stands before its events and its faults.

        ConfigError when it is a second one that heats.
        """
        heats = profile.profile.role in ("heater", "supply")
        if heats and self._heating is not None:
            raise ConfigError(
                f"'{profile.profile.id}' and '{self._heating.profile.profile.id}' would both heat the simulated wire: "
                "attach one of them"
            )
        device = SimulatedDevice(self, profile, unit_id, name, seed=self.seed + len(self.devices))
        self.devices.append(device)
        if heats:
            self._heating = device
        return device

    def inside(self, profile: Profile, tell: Callable[[str], None]) -> Inside:
        """What makes a device of this profile go, and who answers for it."""
        board = self.config.board
        if not profile.has_registers:
            tclab = TCLabFirmware(self.sensors, self._tclab_supply_v(), lambda: self.plant.resistance_ohm, tell)
            return Inside(tclab, tclab)
        firmware = self._register_firmware(profile, tell)
        bank = RegisterBank(profile)
        bank.preset("serial_number", _drawn_serial_number() if board.serial_number is None else board.serial_number)
        bank.preset("firmware_version", FIRMWARE_VERSION)
        return Inside(firmware, Responder(bank, firmware, profile.timing))

    def _tclab_supply_v(self) -> float:
        """What drives the board's limit through the cold wire at the pulse width that the board has at first."""
        limit_v = self.config.board.supply_limit_a * self.config.wire.resistance_cold_ohm
        return limit_v / sqrt(PULSE_FACTORY["P1"] / PULSE_MAX)

    def _register_firmware(self, profile: Profile, tell: Callable[[str], None]) -> RegisterBehaviour:
        match profile.profile.role:
            case "heater":
                return Firmware(self.config.board, self.sensors, tell)
            case "supply":
                return Supply(self.sensors, profile, tell)
            case _:
                return Instrument(self.sensors, profile.timing.update_ms / 1e3)

    def advance_to(self, time_s: float) -> None:
        """Let the time reach `time_s`; nothing happens if it is past."""
        while (remaining_s := time_s - self.time_s) > 1e-9:
            self._tick(min(TICK_S, remaining_s))

    def follow_script(self, script: FaultScript) -> None:
        """From now on let the faults of `script` happen; ConfigError when it names one that there is not."""
        self._timeline = Timeline(bound(script, self.known_faults()), self.tell)
        self._timeline.pass_time(self.time_s)
        if script.random is not None:
            for device in self.devices:
                RandomBusFaults(device.faults, device.power_cycle, seed=self.seed, **script.random.model_dump())

    def known_faults(self) -> dict[str, Callable[..., None]]:
        """Everything that a script can do; the faults of a named device begin with its name and a point."""
        known = self.sensors.faults.by_name() | self.plant.faults.by_name() | self.plant.ageing.by_name()
        for device in self.devices:
            prefix = f"{device.name}." if device.name else ""
            known |= {prefix + name: fault for name, fault in device.faults.by_name().items()}
            known |= {prefix + "reboot": device.power_cycle, prefix + "brown_out": device.brown_out}
        return known

    def switch_off(self) -> None:
        """The simulation ends, and with it the heating."""
        for device in self.devices:
            device.firmware.restart()
        self.tell("heater off, end")

    def tell(self, text: str) -> None:
        """An event, now."""
        line = f"t={self.time_s:.3f} s {text}"
        self.events.append(line)
        if self._log is not None:
            self._log(line)

    def _tick(self, dt_s: float) -> None:
        before_c = self.plant.temperature_c
        if self._heating is None:
            self.plant.advance(0.0, dt_s)
        else:
            firmware = self._heating.firmware
            self.plant.advance(firmware.current_a, dt_s, firmware.voltage_max_v)
        self.sensors.advance(before_c, dt_s)
        self.time_s += dt_s
        for device in self.devices:
            device.firmware.tick(dt_s)
        self._timeline.pass_time(self.time_s)


def _drawn_serial_number() -> int:
    return SystemRandom().choice(SERIAL_NUMBERS)


def simulated_device(
    config: SimConfig, seed: int = 0, profile: Profile | None = None, log: Callable[[str], None] | None = None
) -> SimulatedDevice:
    """The only device of a bench of its own; the reference board by default."""
    return SimulatedBench(config, seed, log).attach(profile or load_profile("sma-reference"))
