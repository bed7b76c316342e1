"""A recorded bus served as devices: the same replies after the same time."""

import pytest

from firmware_sim.bench import SimulatedBench
from firmware_sim.devices.device import Line
from firmware_sim.devices.replay import Replay
from smadrive.clock import VirtualClock
from smadrive.devices.device import Device
from smadrive.devices.profile.profile import load_profile
from smadrive.errors import ConfigError, DeadlineError, ExceptionReply, ProtocolError, SmadriveError
from smadrive.modbus import requests
from smadrive.modbus.bus import BusTiming
from smadrive.modbus.client import ModbusClient
from smadrive.modbus.trace import TraceFile

TIMING = BusTiming(0.1, read_retries=0)


def session(client, faults):
    """The results and errors that a driver gets from a board and a thermometer on one line."""
    seen = []
    board, reader = Device(load_profile("sma-reference"), client), Device(load_profile("delta-dtb"), client, 3)
    board.check_identity()
    for number in range(20):
        client.clock.sleep_until(client.clock.now_s() + 0.1)
        faults(number)
        for act in (
            lambda number=number: board.exchange(
                {"sequence": 0x100 + number, "heater_current": 0.0, "heater_enable": 0},
                ("sequence_echo", "temperature"),
            ),
            lambda: reader.read((reader.profile.role("temperature"),)),
            lambda: client.execute(1, requests.read_holding(5, 1), TIMING),
        ):
            try:
                seen.append((client.clock.now_s(), act()))
            except SmadriveError as error:
                seen.append((client.clock.now_s(), type(error)))
    return seen


def test_replayed_session_equals_the_recorded_one_in_bits_and_time(config, tmp_path):
    bench = SimulatedBench(config, seed=1)
    board = bench.attach(load_profile("sma-reference"))
    reader = bench.attach(load_profile("delta-dtb"), unit_id=3)
    clock = VirtualClock()
    clock.follow(bench.advance_to)
    transport = Line((board, reader)).transport(clock)
    path = tmp_path / "bus.trace"

    def faults(number):
        if number % 5 == 1:
            board.faults.corrupt()
        if number % 5 == 2:
            board.faults.drop()
        if number % 5 == 3:
            board.faults.split(0.01, 3)

    with TraceFile(path, transport) as trace:
        recorded = session(ModbusClient(transport, trace), faults)
    assert {seen for _, seen in recorded if isinstance(seen, type)} == {DeadlineError, ProtocolError, ExceptionReply}

    events = []
    replay = Replay(path, events.append)
    replayed = session(ModbusClient(replay.transport(VirtualClock())), lambda _number: None)
    assert [seen for _, seen in replayed] == [seen for _, seen in recorded]
    assert [time_s for time_s, _ in replayed] == pytest.approx([time_s for time_s, _ in recorded], abs=1e-4)
    assert events == []


def test_replies_come_in_order_the_last_repeats_and_unknown_requests_get_none(tmp_path):
    path = tmp_path / "bus.trace"
    path.write_text(
        "# smadrive bus trace 1: tcp\n"
        "0.0 > 00 01 00 00 00 06 01 03 00 00 00 01\n"
        "0.01 < 00 01 00 00 00 05 01 03 02 00 07\n"
        "0.1 > 00 02 00 00 00 06 01 03 00 00 00 01\n"
        "0.11 < 00 02 00 00 00 05 01 03 02 00 08\n",
        encoding="ascii",
    )
    events = []
    replay = Replay(path, events.append)
    client = ModbusClient(replay.transport(VirtualClock()))
    words = [client.execute(1, requests.read_holding(0, 1), TIMING)[1] for _ in range(4)]
    assert words == [7, 8, 8, 8]
    with pytest.raises(DeadlineError):
        client.execute(1, requests.read_holding(1, 1), TIMING)
    assert events == ["t=0.040 s not in the recording: unit 1, read 1 holding registers from 1"]


@pytest.mark.parametrize("time_s", ["nan", "inf", "1e300", "0.5"])
def test_trace_with_impossible_reply_time_is_rejected(config, tmp_path, time_s):
    transport = Line((SimulatedBench(config).attach(load_profile("sma-reference")),)).transport(VirtualClock())
    path = tmp_path / "bus.trace"
    with TraceFile(path, transport) as trace:
        ModbusClient(transport, trace).execute(1, requests.read_holding(0, 1), TIMING)
    head, sent, received = path.read_text().splitlines()[:3]
    Replay(path)
    mark = received.split()[1]
    path.write_text("\n".join((head, "1.0" + sent[sent.index(" ") :], f"{time_s} {mark}{received.split(mark, 1)[1]}")))
    with pytest.raises(ConfigError):
        Replay(path)
