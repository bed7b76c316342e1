"""A simulated device that loses power, with any firmware."""


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
