"""The board's firmware: state machine, watchdog, limits and latched faults, as docs/sma-reference.md specifies them.

    idle --arm key--> armed --enable = 0--> idle
      any fault (from idle or armed) --> fault --clear key, cause gone--> idle

Current flows only while armed. A fault, and every transition out of `armed`, sets current and enable to zero. Two
events feed the watchdog: arming, and a sequence number that differs from the previous sequence number.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import IntEnum, IntFlag
from math import inf

from firmware_sim.bus.modbus_exception import DEVICE_FAILURE, ILLEGAL_VALUE, ModbusException
from firmware_sim.config import Board
from firmware_sim.sensors.sensors import Sensors

DERATE_C = 5.0
DEBOUNCE_S = 0.03
COLD_JUNCTION_RANGE_C = (-20.0, 85.0)
CURRENT_MARGIN_A = 0.05


class BoardState(IntEnum):
    """The register `state`."""

    IDLE = 0
    ARMED = 1
    FAULT = 2


class BoardFault(IntFlag):
    """The bits of the register `faults`. Each bit is latched."""

    WATCHDOG = 1 << 0
    OVER_TEMPERATURE = 1 << 1
    THERMOCOUPLE_OPEN = 1 << 2
    THERMOCOUPLE_SHORT = 1 << 3
    COLD_JUNCTION_RANGE = 1 << 4
    OVER_CURRENT = 1 << 5
    HEATER_OPEN = 1 << 6


class BoardLimit(IntFlag):
    """The bits of the register `limits`: the limits that hold the current back now."""

    CURRENT_MAX = 1 << 0
    SUPPLY = 1 << 1
    TEMPERATURE = 1 << 2


class BoardFirmware:
    """Reads `sensors` and sets `current_a`. `log_event` gets one line per event, without the time."""

    voltage_max_v = inf  # a current source: the board's limits are all in amperes

    def __init__(self, board: Board, sensors: Sensors, log_event: Callable[[str], None]) -> None:
        self._board = board
        self._supply_limit_a = board.supply_limit_a
        self._sensors = sensors
        self._log_event = log_event
        self.restart()

    def restart(self) -> None:
        """Power up: idle, no fault latched, all settings at their defaults."""
        self.state = BoardState.IDLE
        self.faults = 0
        self.limits = 0
        self.sequence = 0
        self.commanded_a = 0.0
        self.current_a = 0.0
        self.uptime_s = 0.0
        self.watchdog_s = self._board.watchdog_s
        self.temperature_max_c = self._board.temperature_max_c
        self.current_max_a = self._board.supply_limit_a
        self._unfed_s = 0.0
        self._current_wrong_s = 0.0

    def tick(self, dt_s: float) -> None:
        """Run for `dt_s`: check the sensors, count the watchdog, set the current."""
        self.uptime_s += dt_s
        self._unfed_s += dt_s
        causes = self._sensor_faults() + self._current_faults(dt_s)
        if self.state is BoardState.ARMED and self._unfed_s >= self.watchdog_s - 1e-9:
            causes.append(BoardFault.WATCHDOG)
        if causes:
            self._trip(causes)
        self._set_current()

    def check(self, values: Mapping[str, float]) -> None:
        """Raise ModbusException for a limit above the board's own limit, and for arming when the board is not idle."""
        too_hot = values.get("temperature_max", 0.0) > self._board.temperature_max_c
        too_much = values.get("current_max", 0.0) > self._supply_limit_a
        if too_hot or too_much:
            raise ModbusException(ILLEGAL_VALUE)
        if "arm" in values and self.state is not BoardState.IDLE:
            raise ModbusException(DEVICE_FAILURE)

    def write(self, values: Mapping[str, float]) -> None:
        """Carry out a write request. `values` has the written values by role."""
        if values.get("sequence", self.sequence) != self.sequence:
            self.sequence = int(values["sequence"])
            self._unfed_s = 0.0
        self.watchdog_s = values.get("watchdog_s", self.watchdog_s)
        self.temperature_max_c = values.get("temperature_max", self.temperature_max_c)
        self.current_max_a = values.get("current_max", self.current_max_a)
        if "arm" in values:
            self._arm()
        if "fault_clear" in values:
            self._clear()
        self._command(values)
        self._set_current()

    def quantities(self) -> dict[str, float | None]:
        """Return the values that the registers show, by role. None marks a missing reading."""
        sensors = self._sensors
        return {
            "temperature": None if sensors.unreadable else sensors.temperature_c,
            "cold_junction": sensors.cold_junction_c,
            "heater_current": self.commanded_a,
            "heater_enable": 1 if self.state is BoardState.ARMED else 0,
            "measured_current": sensors.current_a,
            "measured_voltage": sensors.voltage_v,
            "displacement": sensors.displacement_mm(),
            "status": self.state.value,
            "faults": self.faults,
            "limits": self.limits,
            "sequence": self.sequence,
            "sequence_echo": self.sequence,
            "sample_counter": sensors.conversions & 0xFFFF,
            "uptime": self.uptime_s,
            "watchdog_s": self.watchdog_s,
            "temperature_max": self.temperature_max_c,
            "current_max": self.current_max_a,
        }

    def _command(self, values: Mapping[str, float]) -> None:
        if self.state is BoardState.ARMED:
            self.commanded_a = values.get("heater_current", self.commanded_a)
        if self.state is BoardState.ARMED and values.get("heater_enable") == 0:
            self._leave_armed(BoardState.IDLE)
            self._log_event("disarmed")

    def _sensor_faults(self) -> list[BoardFault]:
        sensors = self._sensors
        if unreadable := sensors.unreadable:
            return [BoardFault.THERMOCOUPLE_OPEN if unreadable == "open" else BoardFault.THERMOCOUPLE_SHORT]
        faults = []
        if sensors.temperature_c >= self.temperature_max_c:
            faults.append(BoardFault.OVER_TEMPERATURE)
        if not COLD_JUNCTION_RANGE_C[0] <= sensors.cold_junction_c <= COLD_JUNCTION_RANGE_C[1]:
            faults.append(BoardFault.COLD_JUNCTION_RANGE)
        return faults

    def _current_faults(self, dt_s: float) -> list[BoardFault]:
        """Return the faults of the heater current, debounced.

        More current than set means a shorted switch, less than half the set current a broken wire.
        """
        set_a, measured_a = self.current_a, self._sensors.current_a
        excess = measured_a > 1.1 * set_a + CURRENT_MARGIN_A
        lack = set_a > CURRENT_MARGIN_A and measured_a < 0.5 * set_a
        self._current_wrong_s = self._current_wrong_s + dt_s if excess or lack else 0.0
        if self._current_wrong_s < DEBOUNCE_S - 1e-9:
            return []
        return [BoardFault.OVER_CURRENT if excess else BoardFault.HEATER_OPEN]

    def _trip(self, causes: list[BoardFault]) -> None:
        for fault in causes:
            if not fault & self.faults:
                self._log_event(self._event_text(fault))
                self.faults |= fault.value
                self._leave_armed(BoardState.FAULT)

    def _event_text(self, fault: BoardFault) -> str:
        if fault is BoardFault.WATCHDOG:
            return f"watchdog: no new sequence for {self.watchdog_s:.3f} s, heater off"
        if fault is BoardFault.OVER_TEMPERATURE:
            hot_c, limit_c = self._sensors.temperature_c, self.temperature_max_c
            return f"over_temperature: {hot_c:.1f} degC, the limit is {limit_c:g} degC, heater off"
        return f"{(fault.name or '').lower()}: heater off"

    def _arm(self) -> None:
        self.state = BoardState.ARMED
        self._unfed_s = 0.0
        self._log_event(f"armed, watchdog {self.watchdog_s:.3f} s")

    def _clear(self) -> None:
        """Clear the latched faults; a fault whose cause persists latches again at once, or after its debounce."""
        self._log_event("faults cleared")
        self.faults = 0
        self._current_wrong_s = 0.0
        self._leave_armed(BoardState.IDLE)
        self._trip(self._sensor_faults())

    def _leave_armed(self, state: BoardState) -> None:
        self.state = state
        self.commanded_a = 0.0

    def _set_current(self) -> None:
        self.limits = 0
        current_a = self.commanded_a if self.state is BoardState.ARMED else 0.0
        margin_c = self.temperature_max_c - self._sensors.temperature_c
        if current_a > self.current_max_a:
            current_a, self.limits = self.current_max_a, BoardLimit.CURRENT_MAX.value
        if current_a > self._supply_limit_a:
            current_a, self.limits = self._supply_limit_a, self.limits | BoardLimit.SUPPLY.value
        if margin_c < DERATE_C and current_a > (derated_a := self.current_max_a * max(margin_c, 0.0) / DERATE_C):
            current_a, self.limits = derated_a, self.limits | BoardLimit.TEMPERATURE.value
        self.current_a = current_a
