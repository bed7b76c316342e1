"""Random steps for a pair of boards: requests, spoiled frames, noise, readings, faults and times.

The generator knows the map, so that it reaches every state, fault, limit and exception; `reached` counts them.
"""

from __future__ import annotations

import struct
from collections import Counter
from random import Random

from board_pair import ADDRESSES, PROFILE, UNIT_ID

from firmware_sim.devices.board.calibration import GAINS, OFFSETS, BoardCalibration, Correction
from firmware_sim.devices.board.checks import BoardLimit
from firmware_sim.devices.board.readings import BoardFault
from smadrive.modbus.framing import rtu

REGISTERS = PROFILE.registers
WRITABLE = [register for register in REGISTERS.values() if register.writable]
EDGES = (0, 1, 2, 0xFF, 0x100, 0x7FFF, 0x8000, 0xFFFF, 499, 500, 501, 12287, 12288, 20480, 20481, 49, 50, 10000, 10001)
KEYS = {"arm": 0x4152, "fault_clear": 0x434C, "calibration_save": 0x4341}
TIMES_MS = (0, 1, 2, 5, 9, 10, 10, 10, 10, 10, 10)
JUMPS_MS = (29, 30, 49, 50, 51, 249, 500, 501, 9999, 10_000, 0xFFFF, 10_000_000)
CURRENTS = (0, 1, 499, 500, 501, 502, 1000, 3000, 9999, 10_000, 10_001, 50_000)


class BoardFuzzer:
    """Makes random steps on `pair`, and counts what they reach."""

    def __init__(self, pair, seed):
        self.pair = pair
        self.reached = Counter()
        self._random = Random(seed)
        self._sequence = 0x100
        actions = {
            self._tick_of_host: 20,
            self._time_passes: 30,
            self._arm: 6,
            self._clear: 2,
            self._recover: 8,
            self._right_readings: 14,
            self._wrong_readings: 3,
            self._hardware_fault: 1,
            self._hardware_mended: 3,
            self._setting: 4,
            self._random_request: 10,
            self._read: 4,
            self._calibrate: 2,
            self._spoiled: 4,
            self._noise: 2,
            self._pause: 3,
            self._restart: 0.2,
            self._time_jump: 0.3,
        }
        self._actions, self._weights = list(actions), list(actions.values())

    def step(self):
        """Make one random step. DifferenceError if the boards then differ."""
        (action,) = self._random.choices(self._actions, self._weights)
        action()
        self._count()

    def missing(self):
        """Return the states, faults, limits, exceptions and replies that were not reached."""
        expected = [f"state {number}" for number in range(3)]
        expected += [fault.name for fault in BoardFault] + [limit.name for limit in BoardLimit]
        expected += [f"exception {code}" for code in range(1, 5)]
        expected += [f"function {code}" for code in (3, 6, 8, 16, 22, 23)]
        return [name for name in expected if not self.reached[name]]

    def _count(self):
        python = self.pair.python
        self.reached[f"state {python.state.value}"] += 1
        self.reached.update(fault.name for fault in BoardFault(python.faults))
        self.reached.update(limit.name for limit in BoardLimit(python.limits))

    def _ask(self, pdu):
        reply = self.pair.ask(pdu)
        if reply:
            self.reached[f"exception {reply[1]}" if reply[0] & 0x80 else f"function {reply[0]}"] += 1

    def _write(self, name, word):
        self._ask(struct.pack(">BHH", 6, REGISTERS[name].address, word & 0xFFFF))

    def _tick_of_host(self):
        if self._random.random() < 0.9:
            self._sequence = self._sequence + 1 if self._sequence < 0xFFFF else 0x100
        current = self._random.choice((*CURRENTS, self._random.randrange(20_000)))
        enable = self._random.random() < 0.97
        self._ask(struct.pack(">BHHHHBHHH", 23, 16, 14, 32, 3, 6, self._sequence, current, enable))

    def _time_passes(self):
        for _ in range(self._random.randint(1, 3)):
            self.pair.tick(self._random.choice(TIMES_MS))

    def _time_jump(self):
        self.pair.tick(self._random.choice(JUMPS_MS))

    def _arm(self):
        self._write("arm", KEYS["arm"])

    def _clear(self):
        self._write("fault_clear", KEYS["fault_clear"])

    def _recover(self):
        """End all causes of faults, clear the faults and arm, as a user does."""
        self._hardware_mended()
        if self.pair.python.faults:
            self._right_readings()
            self._write("temperature_max", 1600)
            self._write("watchdog_s", 500)
            self._write("calibration_save", KEYS["calibration_save"])
            self._clear()
        self._arm()

    def _right_readings(self):
        """Readings that let the board heat: the current is about the set one."""
        sensors, set_a = self.pair.sensors, self.pair.python.current_a
        sensors.temperature_c = self._random.uniform(20.0, 150.0)
        sensors.cold_junction_c = 25.0
        sensors.current_a = max(0.0, set_a * self._random.uniform(0.98, 1.02))
        sensors.voltage_v = 16.0 * set_a
        sensors.conversions += 1
        self.pair.displacement_mm = self._random.uniform(-1.0, 12.0)
        self.pair.tick(10)

    def _wrong_readings(self):
        sensors, set_a = self.pair.sensors, self.pair.python.current_a
        limit_c = self.pair.python.temperature_max_c
        match self._random.randrange(6):
            case 0:
                sensors.temperature_c = limit_c + self._random.choice((-5.01, -5.0, -4.99, -0.01, 0.0, 0.01, 400.0))
            case 1:
                sensors.temperature_c = self._random.uniform(limit_c - 6.0, limit_c + 1.0)
            case 2:
                sensors.cold_junction_c = self._random.choice((-20.01, -20.0, 85.0, 85.01, 25.0, -500.0, 500.0))
            case 3:
                sensors.current_a = self._random.choice((0.0, 0.5, 0.4999, 1.1, 10.0)) * set_a + self._random.choice(
                    (0.0, 0.0499, 0.05, 0.0501)
                )
            case 4:
                sensors.current_a = self._random.choice((0.0, 0.05, 6.5, 6.6, float("nan")))
            case 5:
                sensors.voltage_v = self._random.choice((0.0, 65.535, 70.0, float("nan")))
        for _ in range(self._random.randrange(5)):
            self.pair.tick(self._random.choice((5, 10)))

    def _hardware_fault(self):
        faults = self.pair.sensors.faults
        self._random.choice(
            (
                faults.open_thermocouple,
                faults.short_thermocouple,
                faults.press_estop,
                faults.silence_sensor_bus,
                faults.stick_actuator,
            )
        )()
        if self._random.random() < 0.5:
            self.pair.tick(10)

    def _hardware_mended(self):
        faults = self.pair.sensors.faults
        for mend in (faults.mend_thermocouple, faults.release_estop, faults.mend_hardware):
            mend()

    def _setting(self):
        name = self._random.choice(("watchdog_s", "temperature_max", "current_max"))
        top = {"watchdog_s": 1000, "temperature_max": 1700, "current_max": 11_000}[name]
        self._write(name, self._random.choice((*EDGES, self._random.randrange(top))))

    def _calibrate(self):
        if self._random.random() < 0.4:
            self._write("calibration_save", KEYS["calibration_save"])
        elif self._random.random() < 0.3:
            self._ask(struct.pack(">BHHB6h", 16, 64, 6, 12, *self._constants()))
        else:
            register = REGISTERS[self._random.choice([name for name in REGISTERS if name.endswith(("gain", "offset"))])]
            self._ask(struct.pack(">BHH", 6, register.address, self._word()))

    def _constants(self):
        return [self._random.choice((16384, 16400, 16300) if at % 2 == 0 else (0, 3, -3)) for at in range(6)]

    def _read(self):
        first = self._random.choice(ADDRESSES)
        self._ask(struct.pack(">BHH", 3, first, self._random.choice((1, 2, 3, 5, 13, 14, 15, 0, 125, 126))))

    def _word(self):
        return self._random.choice((*EDGES, *KEYS.values(), 16384, self._random.randrange(0x10000)))

    def _address(self):
        return self._random.choice((*ADDRESSES, *(one.address for one in WRITABLE), self._random.randrange(0x10000)))

    def _random_request(self):
        self._ask(self._pdu())

    def _pdu(self):
        random = self._random
        written = random.choice((0, 1, 1, 2, 2, 3, 3, 6, 7, 8, 121, 122, 123, 124))
        words = b"".join(self._word().to_bytes(2, "big") for _ in range(written))
        size = random.choices((len(words) & 0xFF, random.randrange(256)), (20, 1))[0]
        payload = (words + bytes(256))[:size]
        return random.choice(
            (
                struct.pack(">BHH", 3, self._address(), random.choice((0, 1, 2, 14, 125, 126, 0xFFFF))),
                struct.pack(">BHH", 6, self._address(), self._word()),
                struct.pack(">BHH", 8, random.choice((0, 0, 1)), self._word()),
                struct.pack(">BHHB", 16, self._address(), written, size) + payload,
                struct.pack(">BHHH", 22, self._address(), self._word(), self._word()),
                struct.pack(">BHHHHB", 23, *self._range(), self._address(), written, size) + payload,
                random.randbytes(random.randint(1, 20)),
            )
        )

    def _range(self):
        return self._address(), self._random.choice((0, 1, 2, 3, 14, 125, 126))

    def _spoiled(self):
        """A request with a flipped bit, a lost end, junk around it, another unit, or twice."""
        random = self._random
        unit_id = random.choice((UNIT_ID, UNIT_ID, UNIT_ID, rtu.BROADCAST, 2))
        frame = bytearray(rtu.seal(unit_id, self._pdu()))
        match random.randrange(5):
            case 0:
                frame[random.randrange(len(frame))] ^= 1 << random.randrange(8)
            case 1:
                del frame[random.randrange(len(frame)) :]
            case 2:
                frame[:0] = random.randbytes(random.randint(1, 4))
            case 3:
                frame += random.randbytes(random.randint(1, 4))
            case 4:
                frame *= 2
        self._send_in_pieces(bytes(frame))

    def _noise(self):
        self._send_in_pieces(self._random.randbytes(self._random.choice((1, 3, 8, 40, 300))))

    def _send_in_pieces(self, data):
        cut = self._random.randrange(len(data) + 1)
        self.pair.send(data[:cut])
        if self._random.random() < 0.3:
            self.pair.tick(self._random.choice((1, 10)))
        self.pair.send(data[cut:])
        if self._random.random() < 0.7:
            self.pair.pause()

    def _pause(self):
        self.pair.pause()

    def _restart(self):
        record = BoardCalibration(*(Correction(*pair) for pair in self._corrections())).record()
        spoiled = bytearray(record)
        spoiled[self._random.randrange(len(spoiled))] ^= 1 << self._random.randrange(8)
        self.pair.restart(self._random.choice((None, record, bytes(spoiled), bytes(14), b"\xff" * 14)))

    def _corrections(self):
        random = self._random
        return [
            (
                random.choice((16384, GAINS[0], GAINS[-1], GAINS[0] - 1)),
                random.choice((0, OFFSETS[0], OFFSETS[-1], 501)),
            )
            if random.random() < 0.3
            else (16384, 0)
            for _ in range(3)
        ]
