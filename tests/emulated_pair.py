"""The program of the microcontroller and the core in this process, with the same requests, faults and times.

The two do not tick at the same moments, so the pair is compared when both have settled, and requests near the end of
the watchdog's time wait until it has expired. Registers that tell time or measured values are not compared.
"""

from __future__ import annotations

import struct
from collections import Counter
from random import Random

from emulated_board import BOOT_S, SEQUENCE_ECHO, UNIT_ID, EmulatedBoard

from firmware_sim.board.core_board import CoreBoard
from firmware_sim.board.emulator.microcontroller import HZ, Converter, Reset, Stuck
from firmware_sim.board.library import Hardware, Inputs
from firmware_sim.config import load_sim
from firmware_sim.devices.board.calibration import BoardCalibration
from firmware_sim.devices.board.readings import NO_READING, NO_TEMPERATURE, BoardFault
from smadrive.modbus.framing import rtu

FIRMWARE_VERSION, SERIAL_NUMBER = 200, 123_456
NOT_COMPARED = {22, 23, 26, 27, 28}
RANGES = ((0, 5), (16, 14), (32, 3), (48, 3), (64, 6))
TICK_MS, NEAR_MS, LATE_FAULT_MS, SETTLE_S, LONG_S = 10, 40, 250, 0.06, 0.9
WATCHDOG, ARMED, NO_DISPLACEMENT = 48, 1, -0x80000000
MENDED_S = 1.5
"""The converter looks for an open circuit once in 16 conversions, so it may show the bit OPEN as long as this."""
BUS = BoardFault.SENSOR_BUS | BoardFault.ACTUATOR
HARDWARE_FAULTS = (
    ("converter", Converter.OPEN, BoardFault.THERMOCOUPLE_OPEN),
    ("converter", Converter.SHORT, BoardFault.THERMOCOUPLE_SHORT),
    ("converter", Converter.ABSENT, BoardFault.SENSOR_BUS),
    ("stuck", Stuck.SDA, BUS),
    ("stuck", Stuck.SCL, BUS),
    ("dac_absent", 1, BoardFault.ACTUATOR),
    ("top_meter_absent", 1, BoardFault.SENSOR_BUS),
    ("bottom_meter_absent", 1, BoardFault.SENSOR_BUS),
    ("estop_open", 1, BoardFault.ESTOP),
)


class EmulatedPair:
    """`program` runs in the emulator, `core` in this process."""

    def __init__(self, seed=0):
        self.program = EmulatedBoard(seed=seed)
        board = load_sim("flexinol-lt-0.15mm").board
        self._hardware = Hardware(
            firmware_version=FIRMWARE_VERSION,
            serial_number=SERIAL_NUMBER,
            watchdog_ms=round(board.watchdog_s * 1e3),
            temperature_max=round(board.temperature_max_c * 10),
            supply_limit=round(board.supply_limit_a * 1e4),
            unit_id=UNIT_ID,
        )
        self.core = CoreBoard(self._hardware, BoardCalibration().record())
        self.detected = 0
        self._power_up_core()

    @property
    def now_ms(self):
        """The time of both, in ms of the program's cycles."""
        return self.program.chip.cycle * 1000 // HZ

    def reset(self):
        """Reset the program by its reset line, and the core."""
        self.program.chip.reset(Reset.LINE)
        self.program.run(BOOT_S)
        self._power_up_core()
        self.compare()

    def run(self, duration_s):
        """Let the time pass for both."""
        self.program.run(duration_s)
        self._catch_up()

    def send(self, frame, masked=()):
        """Send bytes to both, followed by a pause. Their replies must agree, but for the words `masked`."""
        self._wait_for_the_watchdog()
        found = b"".join(self.program.send(frame))
        self._catch_up()
        before = self.core.view.sequence, self.core.view.mode
        expected = self.core.receive(frame, self.now_ms) + self.core.pause(self.now_ms)
        if (self.core.view.sequence, self.core.view.mode) != before:
            self._fed_ms = self.now_ms
        assert without(found, masked) == without(expected, masked), (frame.hex(" "), found.hex(" "), expected.hex(" "))

    def ask(self, pdu):
        """Send a request to both."""
        self.send(rtu.seal(UNIT_ID, pdu), masked_words(pdu))

    def compare(self):
        """Let both settle, and compare registers and current."""
        self.run(0.03)
        self._wait_for_the_watchdog()
        for first, count in RANGES:
            self.ask(struct.pack(">BHH", 3, first, count))
        assert abs(self.program.chip.sink_a * 1e4 - self.core.view.output) <= 1.3  # half a step of the DAC

    def break_hardware(self, field, value, fault):
        """Begin a fault of the hardware for both. The watchdog must not expire before the core learns of the fault."""
        self._wait_for_the_watchdog(LATE_FAULT_MS)
        setattr(self.program.world, field, value)
        self.run(0.11)  # the core learns of it when the converter has
        self.detected = fault.value
        self.run(0.05)

    def mend_hardware(self):
        """End the faults of the hardware."""
        world = self.program.world
        world.converter, world.stuck = Converter.GOOD, Stuck.NONE
        world.dac_absent = world.top_meter_absent = world.bottom_meter_absent = world.estop_open = 0
        self.detected = 0
        self.run(MENDED_S)

    def _power_up_core(self):
        self._hardware.sequence_start = self.program.read(SEQUENCE_ECHO)[0]
        self.core.power_up(self._hardware)
        self._ticked_ms = self._fed_ms = self.now_ms
        self._tick()

    def _catch_up(self):
        while self._ticked_ms + TICK_MS <= self.now_ms:
            self._ticked_ms += TICK_MS
            self._tick()

    def _tick(self):
        world = self.program.world
        is_known = not self.detected
        has_temperature = is_known or world.converter != Converter.ABSENT
        has_power = is_known or not (world.stuck or world.top_meter_absent or world.bottom_meter_absent)
        inputs = Inputs(
            round(world.temperature_c * 100) if has_temperature else NO_TEMPERATURE,
            round(world.cold_junction_c * 100) if has_temperature else NO_TEMPERATURE,
            self.core.view.output if has_power else NO_READING,
            0 if has_power else NO_READING,
            NO_DISPLACEMENT,
            0,
            self.detected,
        )
        self.core.poll(self._ticked_ms)
        self.core.tick(inputs, self._ticked_ms)

    def _wait_for_the_watchdog(self, near_ms=NEAR_MS):
        watchdog_ms = self.core.registers(self.now_ms)[WATCHDOG]
        while self.core.view.mode == ARMED and self.now_ms - self._fed_ms > watchdog_ms - near_ms:
            self.run(SETTLE_S)


def masked_words(pdu):
    """Return the places of the words in the reply that are not compared."""
    if pdu[0] not in (3, 23) or len(pdu) < 5:
        return ()
    first, count = struct.unpack(">HH", pdu[1:5])
    return [place for place in range(min(count, 125)) if first + place in NOT_COMPARED]


def without(reply, masked):
    """Return the reply with zeros in place of the masked words and, if there are any, of the CRC."""
    if not masked or len(reply) < 6:
        return reply
    hidden = bytearray(reply)
    for place in masked:
        hidden[3 + 2 * place : 5 + 2 * place] = b"\0\0"
    return bytes(hidden[:-2])


class EmulatedFuzzer:
    """Makes random steps on a pair, and counts them."""

    def __init__(self, pair, seed):
        self.pair = pair
        self.made = Counter()
        self._random = Random(seed)
        self._sequence = 1000
        self._steps = {
            self.command: 40,
            self.arm: 12,
            self.clear: 8,
            self.setting: 8,
            self.calibration: 3,
            self.read: 8,
            self.random_request: 20,
            self.spoiled: 8,
            self.fault: 2,
            self.long_wait: 3,
            self.reset: 1,
        }

    def step(self):
        """Make one random step, and compare."""
        (step,) = self._random.choices(list(self._steps), self._steps.values())
        self.made[step.__name__] += 1
        step()
        self.pair.compare()
        self.made[f"mode {self.pair.core.view.mode}"] += 1

    def command(self):
        """A tick of a host."""
        self._sequence = self._sequence + 1 if self._random.random() < 0.9 else self._random.randrange(0x10000)
        current = self._random.choice((0, 100, 600, 3000, 9990, 10_500, 50_000, 50_001))
        enable = self._random.choices((1, 0, 2), (20, 2, 1))[0]
        words = (16, 11, 32, 3, 6, self._sequence & 0xFFFF, current, enable)
        self.pair.ask(struct.pack(">BHHHHB3H", 23, *words))

    def arm(self):
        """The key, rarely a wrong one."""
        self.pair.ask(struct.pack(">BHH", 6, 40, 0x4152 if self._random.random() < 0.9 else 0x4153))

    def clear(self):
        """The key that clears faults."""
        self.pair.ask(struct.pack(">BHH", 6, 41, 0x434C))

    def setting(self):
        """A watchdog, a highest temperature or a highest current."""
        address, words = self._random.choice(
            ((48, (49, 200, 500, 5000, 10_000, 10_001)), (49, (390, 420, 1500, 1600, 1601)), (50, (0, 2000, 10_000)))
        )
        self.pair.ask(struct.pack(">BHH", 6, address, self._random.choice(words)))

    def calibration(self):
        """Constants, or the key that saves them."""
        if self._random.random() < 0.3:
            self.pair.ask(struct.pack(">BHH", 6, 70, 0x4341))
            return
        address = self._random.choice((64, 66, 68))
        self.pair.ask(struct.pack(">BHH", 6, address, self._random.choice((12_287, 16_000, 16_384, 16_700))))

    def read(self):
        """A range of registers, some of which do not exist."""
        self.pair.ask(struct.pack(">BHH", 3, self._random.randrange(80), self._random.choice((0, 1, 2, 3, 14, 126))))

    def random_request(self):
        """Any function with any data."""
        random = self._random
        function = random.choice((1, 3, 4, 6, 8, 16, 22, 23, 43, random.randrange(1, 128)))
        address = random.choice((0, 16, 32, 33, 34, 40, 48, 49, 50, 64, 70, random.randrange(0x10000)))
        words = [random.choice((0, 1, 2, 3, 300, 0x4152, 0xFFFF)) for _ in range(random.randrange(1, 4))]
        payload = struct.pack(f">{len(words)}H", *words)
        data = {
            6: struct.pack(">HH", address, words[0]),
            8: struct.pack(">HH", random.choice((0, 0, 1)), words[0]),
            16: struct.pack(">HHB", address, len(words), len(payload)) + payload,
            22: struct.pack(">HHH", address, random.randrange(0x10000), random.randrange(0x10000)),
            23: struct.pack(">HHHHB", 16, random.choice((0, 1, 11)), address, len(words), len(payload)) + payload,
        }.get(function, struct.pack(">HH", address, words[0]))
        self.pair.ask(bytes((function,)) + data)

    def spoiled(self):
        """A frame that is not right, or for another unit."""
        random = self._random
        frame = bytearray(rtu.seal(random.choice((UNIT_ID, UNIT_ID, 0, 9)), struct.pack(">BHH", 6, 40, 0x4152)))
        if random.random() < 0.8:
            frame[random.randrange(len(frame))] ^= 1 << random.randrange(8)
        if random.random() < 0.3:
            del frame[random.randrange(1, len(frame)) :]
        self.pair.send(bytes(frame))

    def fault(self):
        """A fault of the hardware, compared, and mended."""
        self.pair.break_hardware(*self._random.choice(HARDWARE_FAULTS))
        self.pair.compare()
        self.pair.mend_hardware()

    def long_wait(self):
        """Silence, in which the watchdog may expire."""
        self.pair.run(LONG_S)

    def reset(self):
        """The reset line."""
        self.pair.reset()
