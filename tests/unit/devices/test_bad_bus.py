"""On a bus with random faults no wrong value is accepted, and the heater is off at the end. In virtual time."""

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from firmware_sim.bench import simulated_device
from firmware_sim.config import load_sim
from smadrive.clock import VirtualClock
from smadrive.devices.device import Device
from smadrive.devices.heater import Heater
from smadrive.devices.heating.board import HeaterBoard
from smadrive.devices.heating.heat_source import HeaterLimits
from smadrive.devices.profile.profile import load_profile
from smadrive.errors import ExceptionReply, ProtocolError, SmadriveError, TransportError
from smadrive.modbus.client import ModbusClient

NAMES = [
    *("drop", "delay", "duplicate", "corrupt", "truncate", "junk_before", "junk_after", "wrong_unit"),
    *("wrong_function", "short_count", "refuse", "split", "noise", "vanish"),
]
FAULTS = st.lists(
    st.tuples(st.sampled_from(["none"] * 6 + NAMES), st.floats(0.0, 0.6)),
    min_size=1,
    max_size=40,
)


@pytest.mark.exhaustive
@given(FAULTS)
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_bad_bus_gives_no_wrong_value_and_ends_with_the_heater_off(plan):
    """Every measurement belongs to its own exchange. At the end the current is zero, by read-back or by watchdog."""
    clock = VirtualClock()
    rig = simulated_device(load_sim("flexinol-lt-0.15mm"))
    clock.follow(rig.bench.advance_to)
    board = Heater(
        HeaterBoard(Device(load_profile("sma-reference"), ModbusClient(rig.transport(clock))), clock),
        HeaterLimits(0.6, 130.0),
        clock,
    )
    board.connect()
    board.arm(0.5)
    sent_c = {}
    honest = rig.responder.answer

    def noting(pdu):
        reply = honest(pdu)
        sent_c[rig.firmware.sequence] = rig.bench.sensors.temperature_c
        return reply

    rig.responder.answer = noting
    for fault, delay_s in plan:
        clock.sleep_until(clock.now_s() + 0.05)
        spoil(rig.faults, fault, delay_s)
        try:
            measured = board.exchange(0.2)
        except (TransportError, ProtocolError, ExceptionReply):
            continue
        assert measured.temperature_c == pytest.approx(sent_c[rig.firmware.sequence], abs=0.0051)
        assert measured.armed == (rig.firmware.state == 1)
    try:
        board.enter_safe_state()
    except SmadriveError:
        clock.sleep_until(clock.now_s() + 0.6)
    assert rig.firmware.current_a == 0.0


def spoil(faults, fault, amount):
    match fault:
        case "none":
            pass
        case "delay" | "split" | "duplicate" | "noise" | "vanish":
            getattr(faults, fault)(amount)
        case "refuse":
            faults.refuse(4)
        case _:
            getattr(faults, fault)()
