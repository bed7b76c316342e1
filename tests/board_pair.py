"""Two boards side by side, in Python and in C, with the same requests, readings, faults and times.

After each step both boards must have given the same replies, and must show the same registers and the same current.
The frames for the board in Python are found here, by the rules of docs/sma-reference.md.
"""

from __future__ import annotations

from collections import deque
from operator import itemgetter

from firmware_sim.bench import FIRMWARE_VERSION, SimulatedBench
from firmware_sim.board.core_board import CoreBoard
from firmware_sim.board.library import WORDS, Hardware, Inputs
from firmware_sim.config import load_sim
from firmware_sim.devices.board.calibration import BoardCalibration
from firmware_sim.devices.board.firmware import BoardState
from firmware_sim.devices.board.readings import AMPERE, board_readings
from smadrive.devices.profile.profile import load_profile
from smadrive.modbus.framing import rtu

UNIT_ID = 1
SERIAL_NUMBER = 0x89ABCDEF
PROFILE = load_profile("sma-reference")
STEPS_SHOWN = 30
ADDRESSES = sorted(address for register in PROFILE.registers.values() for address in register.addresses)
words_at = itemgetter(*ADDRESSES)
LENGTHS = {3: (8, None), 6: (8, None), 8: (8, None), 16: (9, 6), 22: (10, None), 23: (13, 10)}
"""For each known function: length of a frame without counted bytes, and the position of the byte count."""


class Frames:
    """Finds the requests in a stream of bytes, as docs/sma-reference.md says."""

    def __init__(self):
        self._bytes = b""
        self._ignoring = False

    def take(self, byte):
        """Return the request that ends with this byte, or None."""
        if self._ignoring:
            return None
        self._bytes += bytes((byte,))
        length = self._length()
        if length is None or len(self._bytes) < min(length, rtu.MAX_FRAME + 1):
            self._ignoring = len(self._bytes) > rtu.MAX_FRAME
            return None
        frame, self._bytes = self._bytes, b""
        self._ignoring = len(frame) > rtu.MAX_FRAME or not rtu.crc_holds(frame)
        return None if self._ignoring else frame

    def pause(self):
        """Return the request that ends with the pause, or None."""
        frame, ignoring = self._bytes, self._ignoring
        self._bytes, self._ignoring = b"", False
        unknown = len(frame) >= rtu.MIN_FRAME and frame[1] not in LENGTHS
        return frame if unknown and not ignoring and rtu.crc_holds(frame) else None

    def _length(self):
        if len(self._bytes) < rtu.MIN_FRAME or self._bytes[1] not in LENGTHS:
            return None
        length, at = LENGTHS[self._bytes[1]]
        if at is None:
            return length
        return length + self._bytes[at] if len(self._bytes) > at else None


class DifferenceError(AssertionError):
    """The two boards differ: what differs, and the steps before."""


class BoardPair:
    """Both boards. `sensors` are those of a bench whose wire stays cold: the caller sets its readings and faults."""

    def __init__(self, config=None, seed=0):
        config = config or load_sim("flexinol-lt-0.15mm")
        board = config.board.model_copy(update={"serial_number": SERIAL_NUMBER})
        bench = SimulatedBench(config.model_copy(update={"board": board}), seed)
        device = bench.attach(PROFILE)
        self.sensors, self.python, self._responder = bench.sensors, device.firmware, device.responder
        self.displacement_mm = 0.0
        self.sensors.faults.displacement.begin("set", None, lambda _sample, _age_s: self.displacement_mm)
        self._hardware = Hardware(
            firmware_version=FIRMWARE_VERSION,
            serial_number=SERIAL_NUMBER,
            watchdog_ms=round(board.watchdog_s * 1000),
            temperature_max=round(board.temperature_max_c * 10),
            supply_limit=round(board.supply_limit_a * AMPERE),
            unit_id=UNIT_ID,
        )
        self.core = CoreBoard(self._hardware, BoardCalibration().record())
        self.steps = deque(maxlen=STEPS_SHOWN)
        self._frames = Frames()
        self.restart()

    def restart(self, storage=None):
        """Both boards lose their power for a moment. `storage` replaces the calibration record of both."""
        self.steps.append(("restart", storage))
        self.python.storage = self.core.storage = self.python.storage if storage is None else storage
        self.python.restart()
        self._hardware.sequence_start = self.python.sequence
        self.core.power_up(self._hardware)
        self._frames = Frames()
        self.now_ms = 0
        self._check_core()
        self.compare()

    def tick(self, dt_ms):
        """Let `dt_ms` pass, then both boards check their sensors."""
        self.steps.append(("tick", dt_ms))
        self.now_ms += dt_ms
        self.python.tick(dt_ms / 1000)
        self._check_core()
        self.compare()

    def send(self, data):
        """Both boards receive these bytes; return their replies."""
        self.steps.append(("send", data.hex(" ")))
        expected = b"".join(self._answered(self._frames.take(byte)) for byte in data)
        return self._same_replies(expected, self.core.receive(data, self.now_ms))

    def pause(self):
        """The line is silent; return the reply of both boards."""
        self.steps.append(("pause",))
        return self._same_replies(self._answered(self._frames.pause()), self.core.pause(self.now_ms))

    def ask(self, pdu):
        """Send a request and let the line be silent; return the PDU of the reply."""
        return (self.send(rtu.seal(UNIT_ID, pdu)) + self.pause())[1:-2]

    def compare(self):
        """Raise DifferenceError if registers, storage or current of the two boards differ."""
        bank = self._responder._bank
        bank.publish(self.python.quantities(), "holding", 0, WORDS)
        expected, found = words_at(bank.read("holding", 0, WORDS)), words_at(self.core.registers(self.now_ms))
        pairs = zip(ADDRESSES, expected, found, strict=True)
        self._same("registers", expected, found if expected == found else [row for row in pairs if row[1] != row[2]])
        self._same("current", round(self.python.current_a * AMPERE), self.core.view.output)
        self._same("storage", self.python.storage, self.core.storage)

    def _check_core(self):
        self.core.poll(self.now_ms)
        readings = board_readings(self.sensors)
        inputs = Inputs(*readings[:4], round(self.displacement_mm * 1e4), readings.sample_counter, readings.detected)
        outputs = self.core.tick(inputs, self.now_ms)
        self._same("outputs", (self._is_armed, True), (outputs.enable, outputs.alive))
        self._same("output current", outputs.current, self.core.view.output)

    @property
    def _is_armed(self):
        return self.python.state is BoardState.ARMED

    def _answered(self, frame):
        if frame is None or frame[0] not in (UNIT_ID, rtu.BROADCAST):
            return b""
        reply = self._responder.answer(frame[1:-2])
        return b"" if frame[0] == rtu.BROADCAST else rtu.seal(UNIT_ID, reply)

    def _same_replies(self, expected, found):
        self._same("replies", expected.hex(" "), found.hex(" "))
        self.compare()
        return found

    def _same(self, what, python, core):
        if python != core:
            steps = "\n".join(map(str, self.steps))
            raise DifferenceError(f"{what}: Python {python!r}, C {core!r}, at {self.now_ms} ms after\n{steps}")
