"""A state machine of hypothesis over the pair of boards: any order of requests, readings, faults and times.

Unlike the random steps of `board_fuzz.py`, an order that makes the boards differ is reduced to its shortest form.
"""

import struct

from board_pair import ADDRESSES, PROFILE, UNIT_ID, BoardPair
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from firmware_sim.devices.board.firmware import BoardState
from smadrive.modbus.framing import rtu

WRITABLE = [register for register in PROFILE.registers.values() if register.writable]
FIRSTS = st.sampled_from(ADDRESSES) | st.integers(0, 0xFFFF)
WORDS = st.sampled_from((0, 1, 0xFF, 0x100, 50, 500, 10_000, 16384, 50_000, 0xFFFF)) | st.integers(0, 0xFFFF)
TIMES_MS = st.sampled_from((0, 1, 9, 10, 50, 500, 10_000))
TEMPERATURES_C = st.sampled_from((-300.0, 20.0, 155.0, 157.5, 159.99, 160.0)) | st.floats(-400.0, 400.0)
FAULTS = ("open_thermocouple", "short_thermocouple", "press_estop", "silence_sensor_bus", "stick_actuator")
MENDS = ("mend_thermocouple", "release_estop", "mend_hardware")


def payload(words):
    return struct.pack(f">HB{len(words)}H", len(words), 2 * len(words), *words)


class BoardMachine(RuleBasedStateMachine):
    """The rules are what a host, a line, a wire and a user can do."""

    @initialize(seed=st.integers(0, 3))
    def begin(self, seed):
        self.pair = BoardPair(seed=seed)
        self.sequence = 0x100

    @rule()
    def arm(self):
        self.pair.ask(bytes.fromhex("06 00 28 41 52"))

    @rule()
    def clear(self):
        self.pair.ask(bytes.fromhex("06 00 29 43 4C"))

    @rule(current=WORDS, enable=st.integers(0, 2), is_new=st.booleans())
    def heat(self, current, enable, is_new):
        self.sequence += is_new
        self.pair.ask(struct.pack(">BHHHHBHHH", 23, 16, 14, 32, 3, 6, self.sequence, current, enable))

    @rule(first=FIRSTS, count=st.integers(0, 126))
    def read(self, first, count):
        self.pair.ask(struct.pack(">BHH", 3, first, count))

    @rule(register=st.sampled_from(WRITABLE), word=WORDS)
    def write(self, register, word):
        self.pair.ask(struct.pack(">BHH", 6, register.address, word))

    @rule(register=st.sampled_from([register for register in WRITABLE if register.enum]))
    def write_key(self, register):
        self.pair.ask(struct.pack(">BHH", 6, register.address, max(register.enum)))

    @rule(first=FIRSTS, words=st.lists(WORDS, max_size=8))
    def write_several(self, first, words):
        self.pair.ask(struct.pack(">BH", 16, first) + payload(words))

    @rule(first=FIRSTS, and_mask=WORDS, or_mask=WORDS)
    def mask(self, first, and_mask, or_mask):
        self.pair.ask(struct.pack(">BHHH", 22, first, and_mask, or_mask))

    @rule(read=FIRSTS, count=st.integers(0, 15), write=FIRSTS, words=st.lists(WORDS, max_size=8))
    def exchange(self, read, count, write, words):
        self.pair.ask(struct.pack(">BHHH", 23, read, count, write) + payload(words))

    @rule(data=st.binary(min_size=1, max_size=30))
    def send_noise(self, data):
        self.pair.send(data)

    @rule(unit_id=st.sampled_from((0, 1, 2)), pdu=st.binary(min_size=2, max_size=20))
    def send_frame(self, unit_id, pdu):
        self.pair.send(rtu.seal(unit_id, pdu))

    @rule(at=st.integers(0, 30), bit=st.integers(0, 7))
    def send_spoiled_command(self, at, bit):
        frame = bytearray(rtu.seal(UNIT_ID, bytes.fromhex("10 00 20 00 03 06 7F FF 0B B8 00 01")))
        frame[at % len(frame)] ^= 1 << bit
        self.pair.send(bytes(frame))

    @rule()
    def pause(self):
        self.pair.pause()

    @rule(dt_ms=TIMES_MS)
    def check(self, dt_ms):
        self.pair.tick(dt_ms)

    @rule(temperature_c=TEMPERATURES_C, cold_junction_c=st.floats(-30.0, 95.0))
    def read_temperatures(self, temperature_c, cold_junction_c):
        self.pair.sensors.temperature_c, self.pair.sensors.cold_junction_c = temperature_c, cold_junction_c
        self.pair.sensors.conversions += 1

    @rule(share=st.sampled_from((0.0, 0.499, 0.5, 1.0, 1.1, 1.2)), more_a=st.sampled_from((0.0, 0.05, 0.0501, 7.0)))
    def read_current(self, share, more_a):
        self.pair.sensors.current_a = share * self.pair.python.current_a + more_a
        self.pair.sensors.voltage_v = 16.0 * self.pair.sensors.current_a

    @rule(displacement_mm=st.floats(-1e4, 1e4))
    def read_displacement(self, displacement_mm):
        self.pair.displacement_mm = displacement_mm
        self.pair.tick(10)

    @rule(name=st.sampled_from((*FAULTS, *MENDS)))
    def change_hardware(self, name):
        getattr(self.pair.sensors.faults, name)()

    @rule(storage=st.none() | st.binary(min_size=14, max_size=14))
    def restart(self, storage):
        self.pair.restart(storage)

    @invariant()
    def no_current_unless_armed(self):
        if hasattr(self, "pair") and self.pair.python.state is not BoardState.ARMED:
            assert self.pair.core.view.output == 0
