"""The emulated board on a simulated bench: the wire and its sensors at the pins and chips of the microcontroller.

The emulated chips measure the readings of `Sensors`, as the chips of a real board measure the wire: the temperature at
the thermocouple, the current as the voltage of a shunt, and the voltages at both ends of the wire. A contact opens when
the emergency stop is pressed. The highest current needs a certain voltage at the cold wire. The supply of the wire has
1.1 times this voltage plus 1 V.
"""

from __future__ import annotations

from collections.abc import Callable
from math import isnan
from random import Random

from firmware_sim.board.atmega328p.eeprom import image
from firmware_sim.board.emulator.build import firmware_file, range_for
from firmware_sim.board.emulator.microcontroller import HZ, Converter, Microcontroller, Reset
from firmware_sim.board.emulator.serial_line import SerialLine
from firmware_sim.config import SimConfig
from firmware_sim.sensors.sensors import Sensors

BOOT_S = 0.5
"""The board is powered up this long before the simulation begins, so it answers from the beginning."""
SUPPLY_MARGIN = 1.1
SUPPLY_DROP_V = 1.0
DISPLACEMENT_V_PER_MM = 1.1 / 1024 / 0.022
"""A step of the analogue input, 1.1 V / 1024, stands for 0.022 mm."""
_CONVERTER = {"open": Converter.OPEN, "short": Converter.SHORT, "stopped": Converter.STOPPED}


class EmulatedFirmware:
    """The firmware of the ATmega328P, run by an emulator. It reads `sensors` through the emulated chips."""

    def __init__(
        self,
        config: SimConfig,
        sensors: Sensors,
        log_event: Callable[[str], None],
        serial_number: int,
        seed: int = 0,
    ) -> None:
        """Build and start the firmware for `config.board`. ConfigError if it cannot be built."""
        board = config.board
        self.chip = Microcontroller(firmware_file(board), Random(seed).getrandbits(32))
        self.voltage_max_v = SUPPLY_MARGIN * board.supply_limit_a * config.wire.resistance_cold_ohm + SUPPLY_DROP_V
        self._sensors = sensors
        self._log_event = log_event
        self._time_s = 0.0
        self._was_on = False
        self._resets = 0
        self.chip.write_eeprom(image(serial_number))
        fitted = range_for(board.supply_limit_a)
        world = self.chip.world
        world.full_scale_a, world.shunt_ohm = fitted.full_scale_a, fitted.shunt_ohm
        world.displacement_fitted = config.displacement is not None
        self._show()
        self.chip.run(BOOT_S)
        self._start_cycle = self.chip.cycle
        self.line = SerialLine(self.chip, self._start_cycle)

    @property
    def current_a(self) -> float:
        """The set current of the sink, A; 0 while the enable line of the sink is low."""
        return self.chip.sink_a

    def restart(self) -> None:
        """Switch the supply of the board off and on."""
        self.chip.reset(Reset.POWER)
        self._note_changes()

    def tick(self, dt_s: float) -> None:
        """Move the simulation by `dt_s`, and run the board until the same time.

        After a request the board may already be ahead of this time. Then it executes nothing.
        """
        self._time_s += dt_s
        self._show()
        self.chip.run_until(self._start_cycle + round(self._time_s * HZ))
        self._note_changes()

    def answer(self, pdu: bytes) -> bytes:
        """Send the request `pdu` to the board, and return the PDU of its reply."""
        return self.line.answer(pdu)

    def _show(self) -> None:
        sensors, world = self._sensors, self.chip.world
        findings = sensors.findings
        world.temperature_c, world.cold_junction_c = sensors.temperature_c, sensors.cold_junction_c
        world.converter = _CONVERTER.get(sensors.faults.thermocouple.name, Converter.GOOD)
        world.current_a = 0.0 if isnan(sensors.current_a) else sensors.current_a
        wire_v = 0.0 if isnan(sensors.voltage_v) else sensors.voltage_v
        world.wire_top_v, world.wire_bottom_v = self.voltage_max_v, self.voltage_max_v - wire_v
        world.top_meter_absent = isnan(sensors.current_a) or "silent" in findings
        world.bottom_meter_absent = isnan(sensors.voltage_v)
        world.dac_absent = "stuck" in findings
        world.estop_open = "pressed" in findings
        world.displacement_v = DISPLACEMENT_V_PER_MM * max(sensors.displacement_mm() or 0.0, 0.0)

    def _note_changes(self) -> None:
        is_on = self.chip.sink_a > 0.0
        if is_on != self._was_on:
            self._log_event("heater on" if is_on else "heater off")
        resets = int(self.chip.probes.resets_by_watchdog)
        if resets > self._resets:
            self._log_event("reset by the hardware watchdog")
        self._was_on, self._resets = is_on, resets
