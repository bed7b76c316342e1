"""The board's firmware: state machine, watchdog, limits and latched faults, as docs/sma-reference.md specifies them.

    idle --arm key--> armed --enable = 0--> idle
      any fault (from idle or armed) --> fault --clear key, cause gone--> idle

Current flows only while armed. A fault, and every transition out of `armed`, sets current and enable to zero. Two
events feed the watchdog: arming, and a sequence number that differs from the previous sequence number.

All numbers are counts of the registers, and all times are whole milliseconds. So another implementation of the board
can agree to the last bit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import IntEnum
from math import inf
from random import Random

from firmware_sim.bus.modbus_exception import ModbusException
from firmware_sim.config import Board
from firmware_sim.devices.board.calibration import BoardCalibration
from firmware_sim.devices.board.checks import BoardLimit, CurrentCheck, sensor_faults, temperature_limit
from firmware_sim.devices.board.readings import (
    AMPERE,
    DEGREE,
    NO_READING,
    NO_TEMPERATURE,
    VOLT,
    BoardFault,
    board_readings,
)
from firmware_sim.devices.board.scales import CONSTANTS, SCALES, SETTINGS, count_of, sequence_start
from firmware_sim.sensors.sensors import Sensors
from smadrive.modbus.verdict import ExceptionCode

FAULTS_OF_VERSION_1 = 0x7F
_NOT_ARMED = {"calibration_save", *CONSTANTS}


class BoardState(IntEnum):
    """The register `state`."""

    IDLE = 0
    ARMED = 1
    FAULT = 2


class BoardFirmware:
    """Reads `sensors` and sets `current_a`. `log_event` gets one line per event, without the time.

    `map_version` is 1 or 2. `storage` holds the calibration record, and survives a restart. `seed` determines the
    random starts of the sequence.
    """

    voltage_max_v = inf  # a current source: the board does not limit the voltage

    def __init__(
        self, board: Board, sensors: Sensors, log_event: Callable[[str], None], map_version: int = 2, seed: int = 0
    ) -> None:
        self._map_version = map_version
        own = (board.watchdog_s, board.temperature_max_c, board.supply_limit_a)
        self._own = {role: count_of(role, value) for role, value in zip(SETTINGS, own, strict=True)}
        self._sensors = sensors
        self._log_event = log_event
        self._random = Random(seed)
        self._current_check = CurrentCheck()
        self.storage = BoardCalibration().record()
        self.restart()

    def restart(self) -> None:
        """Power up: idle, no fault latched, all settings at their defaults, calibration from the storage."""
        self.state = BoardState.IDLE
        self.faults = 0
        self.limits = 0
        self.sequence = sequence_start(self._random) if self._map_version > 1 else 0
        self._commanded = self._set = 0
        self.uptime_s = 0.0
        self._settings = dict(self._own)
        self._fed_ms = self._checked_ms = 0
        self._current_check.restart()
        stored = BoardCalibration.of_record(self.storage)
        self._is_calibrated = stored is not None
        self._calibrate(stored or BoardCalibration())
        self._check_all()

    @property
    def current_a(self) -> float:
        """The current that the source is set to: the set current, calibrated."""
        return self._calibration.source.applied(self._set) / AMPERE if self._set else 0.0

    @property
    def commanded_a(self) -> float:
        """The register `heater_current`."""
        return self._commanded / AMPERE

    @property
    def watchdog_s(self) -> float:
        """The register `watchdog_s`."""
        return self._settings["watchdog_s"] / 1000

    @property
    def temperature_max_c(self) -> float:
        """The register `temperature_max`."""
        return self._settings["temperature_max"] / 10

    @property
    def current_max_a(self) -> float:
        """The register `current_max`."""
        return self._settings["current_max"] / AMPERE

    def tick(self, dt_s: float) -> None:
        """Run for `dt_s`: check the sensors and the watchdog, set the current."""
        self.uptime_s += dt_s
        self._check_all()

    def check(self, values: Mapping[str, float]) -> None:
        """Raise ModbusException for a limit above the board's own limit, and for a write that the state forbids."""
        if any(count_of(role, values[role]) > self._own[role] for role in SETTINGS[1:] if role in values):
            raise ModbusException(ExceptionCode.ILLEGAL_VALUE)
        is_calibrated_armed = self.state is BoardState.ARMED and not _NOT_ARMED.isdisjoint(values)
        if is_calibrated_armed or ("arm" in values and self.state is not BoardState.IDLE):
            raise ModbusException(ExceptionCode.DEVICE_FAILURE)

    def write(self, values: Mapping[str, float]) -> None:
        """Carry out a write request. `values` has the written values by role."""
        if values.get("sequence", self.sequence) != self.sequence:
            self.sequence = int(values["sequence"])
            self._fed_ms = self._now_ms()
        self._settings |= {role: count_of(role, values[role]) for role in SETTINGS if role in values}
        for role in CONSTANTS:
            if role in values:
                self._calibrate(self._calibration.changed(role, count_of(role, values[role])))
        if "calibration_save" in values:
            self.storage, self._is_calibrated = self._calibration.record(), True
        if "arm" in values:
            self._arm()
        if "fault_clear" in values:
            self._clear()
        self._command(values)
        self._set_current()

    def quantities(self) -> dict[str, float | None]:
        """Return the values that the registers show, by role. None marks a missing reading."""
        readings = self._readings
        return {
            **{role: count / SCALES[role] for role, count in self._settings.items()},
            **self._constants,
            "temperature": None if readings.temperature == NO_TEMPERATURE else readings.temperature / DEGREE,
            "cold_junction": readings.cold_junction / DEGREE,
            "heater_current": self.commanded_a,
            "heater_enable": 1 if self.state is BoardState.ARMED else 0,
            "measured_current": None if readings.current == NO_READING else readings.current / AMPERE,
            "measured_voltage": None if readings.voltage == NO_READING else readings.voltage / VOLT,
            "displacement": self._sensors.displacement_mm(),
            "status": self.state.value,
            "faults": self.faults,
            "limits": self.limits,
            "sequence": self.sequence,
            "sequence_echo": self.sequence,
            "sample_counter": readings.sample_counter,
            "uptime": self._now_ms() / 1000,
            "estop": 1 if readings.detected & BoardFault.ESTOP else 0,
        }

    def _calibrate(self, calibration: BoardCalibration) -> None:
        self._calibration = calibration
        self._constants = {role: calibration.constant(role) / SCALES[role] for role in CONSTANTS}

    def _now_ms(self) -> int:
        return round(self.uptime_s * 1e6) // 1000

    def _check_all(self) -> None:
        now_ms = self._now_ms()
        self._read_sensors()
        causes = self._sensor_faults()
        causes |= self._current_check.faults(self._readings.current, self._set, now_ms - self._checked_ms)
        self._checked_ms = now_ms
        if self.state is BoardState.ARMED and now_ms - self._fed_ms >= self._settings["watchdog_s"]:
            causes |= BoardFault.WATCHDOG.value
        self._trip(causes)
        self._set_current()

    def _read_sensors(self) -> None:
        readings, calibration = board_readings(self._sensors), self._calibration
        current = calibration.current.measured(readings.current)
        voltage = calibration.voltage.measured(readings.voltage)
        if self._map_version == 1 and NO_READING in (current, voltage):
            current = voltage = 0  # a board of this version shows no missing reading
        self._readings = readings._replace(current=current, voltage=voltage)

    def _sensor_faults(self) -> int:
        faults = sensor_faults(self._readings, self._settings["temperature_max"])
        if self._map_version == 1:
            return faults & FAULTS_OF_VERSION_1
        return faults if self._is_calibrated else faults | BoardFault.SELF_TEST.value

    def _trip(self, causes: int) -> None:
        if new := causes & ~self.faults:
            for fault in BoardFault(new):
                self._log_event(self._event_text(fault))
            self.faults |= causes
            self._leave_armed(BoardState.FAULT)

    def _event_text(self, fault: BoardFault) -> str:
        if fault is BoardFault.WATCHDOG:
            return f"watchdog: no new sequence for {self.watchdog_s:.3f} s, heater off"
        if fault is BoardFault.OVER_TEMPERATURE:
            hot_c, limit_c = self._readings.temperature / DEGREE, self.temperature_max_c
            return f"over_temperature: {hot_c:.1f} degC, the limit is {limit_c:g} degC, heater off"
        return f"{(fault.name or '').lower()}: heater off"

    def _command(self, values: Mapping[str, float]) -> None:
        if self.state is not BoardState.ARMED:
            return
        self._commanded = count_of("heater_current", values.get("heater_current", self.commanded_a))
        if values.get("heater_enable") == 0:
            self._leave_armed(BoardState.IDLE)
            self._log_event("disarmed")

    def _arm(self) -> None:
        self.state = BoardState.ARMED
        self._fed_ms = self._now_ms()
        self._log_event(f"armed, watchdog {self.watchdog_s:.3f} s")

    def _clear(self) -> None:
        """Clear the latched faults; a fault whose cause persists latches again at once, or after its debounce."""
        self._log_event("faults cleared")
        self.faults = 0
        self._current_check.restart()
        self._leave_armed(BoardState.IDLE)
        self._trip(self._sensor_faults())

    def _leave_armed(self, state: BoardState) -> None:
        self.state = state
        self._commanded = self._set = 0

    def _set_current(self) -> None:
        """Apply the limits to the commanded current."""
        self.limits, self._set = 0, self._commanded if self.state is BoardState.ARMED else 0
        settings = self._settings
        near = temperature_limit(self._readings.temperature, settings["temperature_max"], settings["current_max"])
        for limit, highest in (
            (BoardLimit.SUPPLY, self._own["current_max"]),
            (BoardLimit.CURRENT_MAX, settings["current_max"]),
            (BoardLimit.TEMPERATURE, near),
        ):
            if highest is not None and self._set > highest:
                self._set, self.limits = highest, self.limits | limit.value
