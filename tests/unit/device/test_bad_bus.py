"""Whatever happens on the bus, no wrong value passes and the heater ends off: fuzzed, in virtual time."""

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from firmware_sim.config import load_sim
from firmware_sim.device import SimulatedDevice
from smadrive.clock import VirtualClock
from smadrive.device.board import HeaterBoard
from smadrive.device.device import Device
from smadrive.device.heater import Heater
from smadrive.device.heatsource import HeaterLimits
from smadrive.device.profile import load_profile
from smadrive.errors import ProtocolError, SmadriveError, TransportError
from smadrive.modbus import frames
from smadrive.modbus.master import Master

FAULTS = st.lists(
    st.tuples(
        st.sampled_from(["none", "none", "drop", "delay", "corrupt", "truncate", "unit", "junk"]), st.floats(0.0, 0.6)
    ),
    min_size=1,
    max_size=40,
)


@given(FAULTS)
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_whatever_the_bus_does_no_wrong_value_is_taken_and_the_heater_ends_off(plan):
    """Every measurement is the rig's of this very exchange; afterwards zero current, by read-back or by watchdog."""
    clock = VirtualClock()
    rig = SimulatedDevice.from_config(load_sim("flexinol-lt-0.15mm"))
    clock.follow(rig.advance_to)
    board = Heater(
        HeaterBoard(Device(load_profile("sma-reference"), Master(rig.transport(clock))), clock),
        HeaterLimits(0.6, 130.0),
        clock,
    )
    board.connect()
    board.arm(0.5)
    sent_c = {}
    honest = rig.faults.apply

    def noting(frame, time_s):
        sent_c[rig.firmware.sequence] = rig.sensors.temperature_c
        return honest(frame, time_s)

    rig.faults.apply = noting
    for fault, delay_s in plan:
        clock.sleep_until(clock.now_s() + 0.05)
        spoil(rig.faults, fault, delay_s)
        try:
            measured = board.exchange(0.2)
        except (TransportError, ProtocolError):
            continue
        assert measured.temperature_c == pytest.approx(sent_c[rig.firmware.sequence], abs=0.0051)
        assert measured.armed == (rig.firmware.state == 1)
    try:
        board.enter_safe_state()
    except SmadriveError:
        clock.sleep_until(clock.now_s() + 0.6)
    assert rig.firmware.current_a == 0.0


def spoil(faults, fault, delay_s):
    match fault:
        case "drop" | "corrupt" | "truncate":
            getattr(faults, fault)()
        case "delay":
            faults.delay(delay_s)
        case "unit":
            faults.replace(lambda frame: frames.seal(2, frame[1:-2]))
        case "junk":
            faults.replace(lambda frame: b"\xff\x00" + frame)
