"""A simulated board that runs the C core: the same interfaces as the board in Python."""

from __future__ import annotations

from collections.abc import Callable
from math import inf, isnan
from random import Random

from firmware_sim.board.core_board import CoreBoard
from firmware_sim.board.library import Hardware, Inputs
from firmware_sim.config import Board
from firmware_sim.devices.board.calibration import BoardCalibration
from firmware_sim.devices.board.readings import AMPERE, MILLIMETRE, BoardFault, board_readings
from firmware_sim.devices.board.scales import sequence_start
from firmware_sim.sensors.sensors import Sensors
from smadrive.modbus.framing import rtu

UNIT_ID = 1
NO_DISPLACEMENT = -0x80000000


class NativeBoard:
    """Reads `sensors`, sets `current_a` and answers requests. `log_event` gets one line per event, without the time.

    The registers show `serial_number` and `firmware_version`. `seed` determines the random starts of the sequence.
    """

    voltage_max_v = inf  # a current source: the board does not limit the voltage

    def __init__(
        self,
        board: Board,
        sensors: Sensors,
        log_event: Callable[[str], None],
        *,
        serial_number: int,
        firmware_version: int,
        seed: int = 0,
    ) -> None:
        self._hardware = Hardware(
            firmware_version=firmware_version,
            serial_number=serial_number,
            watchdog_ms=round(board.watchdog_s * 1000),
            temperature_max=round(board.temperature_max_c * 10),
            supply_limit=round(board.supply_limit_a * AMPERE),
            unit_id=UNIT_ID,
        )
        self._sensors = sensors
        self._log_event = log_event
        self._random = Random(seed)
        self._core = CoreBoard(self._hardware, BoardCalibration().record())
        self.restart()

    def restart(self) -> None:
        """Power up. The sequence starts at a new random number."""
        self.uptime_s = 0.0
        self._hardware.sequence_start = sequence_start(self._random)
        self._core.power_up(self._hardware)
        self._check()

    def tick(self, dt_s: float) -> None:
        """Run for `dt_s`: the safety interrupt and the main loop."""
        self.uptime_s += dt_s
        self._check()

    def answer(self, pdu: bytes) -> bytes:
        """Carry out a request, and return the PDU of the reply."""
        now_ms = self._now_ms()
        reply = self._core.receive(rtu.seal(UNIT_ID, pdu), now_ms) or self._core.pause(now_ms)
        return reply[1:-2]

    @property
    def current_a(self) -> float:
        """The current that the source is set to."""
        return float(self._core.view.output) / AMPERE

    def _now_ms(self) -> int:
        return round(self.uptime_s * 1e6) // 1000 & 0xFFFFFFFF

    def _check(self) -> None:
        before = self._core.view.faults
        self._core.poll(self._now_ms())
        self._core.tick(self._inputs(), self._now_ms())
        for fault in BoardFault(self._core.view.faults & ~before):
            self._log_event(f"{(fault.name or '').lower()}: heater off")

    def _inputs(self) -> Inputs:
        readings, displacement_mm = board_readings(self._sensors), self._sensors.displacement_mm()
        return Inputs(
            readings.temperature,
            readings.cold_junction,
            readings.current,
            readings.voltage,
            _displacement(displacement_mm),
            readings.sample_counter,
            readings.detected,
        )


def _displacement(displacement_mm: float | None) -> int:
    if displacement_mm is None or isnan(displacement_mm):
        return NO_DISPLACEMENT
    return min(max(round(displacement_mm * MILLIMETRE), NO_DISPLACEMENT + 1), 0x7FFFFFFF)
