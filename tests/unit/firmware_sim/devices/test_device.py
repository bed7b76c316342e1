"""A simulated device that loses power, or gets requests in quick succession, with any firmware."""

import pytest

from firmware_sim.bench import simulated_device
from firmware_sim.config import load_sim
from smadrive.devices.profile.profile import load_profile
from smadrive.modbus import requests
from smadrive.modbus.framing import rtu


def test_wire_cools_in_a_brown_out_and_device_restarts(bench, watch):
    hot_c, (device,) = bench.plant.temperature_c, bench.devices
    bench.known_faults()["supply.brown_out"](for_s=3.0)
    request = bytes.fromhex("01 03 00 12 00 01 24 0F")  # the output
    assert watch(bench, 2.9, lambda bench: device.line.receive(request, bench.time_s))[-1] == []
    assert bench.plant.temperature_c < hot_c - 20.0
    bench.advance_to(24.0)
    ((_, reply),) = device.line.receive(request, bench.time_s)
    assert reply[3:5] == b"\0\0"
    assert device.firmware.current_a == 0.0


def test_supply_that_starts_with_its_output_on_heats_after_the_brown_out_only(bench, watch):
    (device,) = bench.devices
    device.firmware.write({"boot_power": 1.0})
    device.brown_out(3.0)
    assert max(watch(bench, 2.98, lambda bench: bench.plant.current_a)) == 0.0
    bench.advance_to(23.02)
    assert bench.plant.current_a == pytest.approx(0.25)


def test_power_returns_after_the_longest_of_several_brown_outs(bench, watch):
    (device,) = bench.devices
    device.firmware.write({"boot_power": 1.0})
    device.brown_out(3.0)
    bench.advance_to(21.0)
    device.power_cycle()
    assert max(watch(bench, 1.98, lambda bench: bench.plant.current_a)) == 0.0
    bench.advance_to(23.02)
    assert bench.plant.current_a == pytest.approx(0.25)


def test_minimum_gap_is_not_required_while_the_time_stands_still():
    device = simulated_device(load_sim("flexinol-lt-0.15mm"), profile=load_profile("delta-dtb"))
    read = rtu.seal(1, requests.read_holding(0x1000, 1).pdu)
    device.bench.advance_to(1.0)
    assert [len(device.line.receive(read, time_s)) for time_s in (1.0, 1.0, 1.005, 1.02)] == [1, 1, 0, 1]
    device.brown_out(for_s=5.0)
    assert device.line.receive(read, 1.02) == []
