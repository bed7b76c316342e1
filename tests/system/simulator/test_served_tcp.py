"""firmware-sim on a TCP port: conformance, the driver through both protocols, a third-party client."""

import contextlib
import os
import re
import resource
import shutil
import signal
import socket
import subprocess

import programs
import pytest
from served import COMMAND, PATIENT, SIM, served

from firmware_sim.server.readiness import readable
from firmware_sim.server.tcp_endpoint import MAX_CLIENTS
from smadrive.clock import MonotonicClock
from smadrive.devices.device import Device
from smadrive.devices.heater import Heater
from smadrive.devices.heating.board import HeaterBoard
from smadrive.devices.heating.heat_source import HeaterLimits
from smadrive.devices.profile.profile import load_profile
from smadrive.modbus.client import ModbusClient
from smadrive.modbus.framing import mbap
from smadrive.modbus.transports.connect import open_transport


@pytest.fixture(scope="module")
def thermometer():
    with served("--tcp", "0", "--profile", "adam-6018") as (_, url):
        yield url


@pytest.fixture
def wire(thermometer):
    address = re.fullmatch(r"tcp://(127\.0\.0\.1):(\d+)", thermometer)
    with socket.create_connection((address[1], int(address[2])), 5.0) as connection:
        yield connection


def answer(wire, quiet_s=5.0):
    """Return the next frame, or None after `quiet_s` without a frame."""
    wire.settimeout(quiet_s)
    data = b""
    try:
        while mbap.frame_size(data) is None or len(data) < mbap.frame_size(data):
            data += wire.recv(1)
    except TimeoutError:
        assert data == b""
        return None
    return data


@pytest.mark.parametrize(
    ("pdu", "reply"),
    [
        ("03 00 00 00 00", "83 03"),
        ("03 00 00 00 7E", "83 03"),
        ("63 00 00", "E3 01"),
        ("03 00 64 00 01", "83 02"),
        ("03 FF FF 00 02", "83 02"),
        ("10 00 00 00 02 03 00 07 00", "90 03"),
        ("03 00 00", "83 03"),
        ("03", "83 03"),
        ("05 00 10 12 34", "85 03"),
        ("17 00 00 00 00 00 00 00 01 02 00 00", "97 03"),
        ("17 00 00 00 01 00 00 00 00 00", "97 03"),
    ],
)
def test_request_gets_the_reply_of_the_standard(wire, pdu, reply):
    wire.sendall(mbap.seal(0x1234, 1, bytes.fromhex(pdu)))
    assert answer(wire) == mbap.seal(0x1234, 1, bytes.fromhex(reply))


READ = bytes.fromhex("01 00 10 00 08")
REPLY = bytes.fromhex("01 01 00")


def test_units_0_and_255_reach_the_device_and_other_units_get_a_gateway_exception(wire):
    for unit_id, reply in ((9, b"\x81\x0b"), (0, REPLY), (255, REPLY), (1, REPLY)):
        wire.sendall(mbap.seal(7, unit_id, READ))
        assert answer(wire) == mbap.seal(7, unit_id, reply)


def test_frame_of_another_protocol_is_dropped_and_the_next_request_answered(wire):
    foreign = bytearray(mbap.seal(1, 1, READ))
    foreign[3] = 5
    wire.sendall(bytes(foreign))
    assert answer(wire, quiet_s=0.2) is None
    wire.sendall(mbap.seal(2, 1, READ))
    assert answer(wire) == mbap.seal(2, 1, REPLY)


def test_impossible_length_drops_pending_bytes_only(wire):
    wire.sendall(bytes.fromhex("0001 0000 FFFF 01") + READ)
    assert answer(wire, quiet_s=0.2) is None
    wire.sendall(mbap.seal(2, 1, READ))
    assert answer(wire) == mbap.seal(2, 1, REPLY)


def test_requests_in_one_segment_are_answered_in_order(wire):
    wire.sendall(b"".join(mbap.seal(number, 1, READ) for number in range(1, 6)))
    assert [answer(wire) for _ in range(5)] == [mbap.seal(number, 1, REPLY) for number in range(1, 6)]


def test_request_byte_by_byte_is_answered(wire):
    wire.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    for byte in mbap.seal(3, 1, READ):
        wire.sendall(bytes((byte,)))
    assert answer(wire) == mbap.seal(3, 1, REPLY)


def test_clients_do_not_disturb_each_other(wire, thermometer):
    half = mbap.seal(4, 1, READ)
    wire.sendall(half[:6])
    profile = load_profile("adam-6018")
    for _ in range(3):
        with open_transport(thermometer + PATIENT) as transport:
            device = Device(profile, ModbusClient(transport))
            device.write("do_3", 1)
            assert device.read(("do_3", "tc_0"))["tc_0"].value == pytest.approx(22.0, abs=1.0)
            device.write("do_3", 0)
    wire.sendall(half[6:])
    assert answer(wire) == mbap.seal(4, 1, REPLY)


@pytest.mark.skipif(shutil.which("mbpoll") is None, reason="needs mbpoll (Debian package mbpoll)")
def test_third_party_client_reads_the_temperature(thermometer):
    port = thermometer.rpartition(":")[2]
    run = subprocess.run(
        ["mbpoll", "-m", "tcp", "-p", port, "-a1", "-0", "-1", "-r0", "-c8", "127.0.0.1"],
        capture_output=True,
        text=True,
        check=True,
    )
    words = [int(word) for word in re.findall(r"\[\d\]:\s+(\d+)", run.stdout)]
    profile = load_profile("adam-6018")
    assert profile.register("tc_0").codec.decode(words[:1]).value == pytest.approx(22.0, abs=1.0)
    assert len(words) == 8


@pytest.mark.parametrize("option", ["--tcp", "--rtu-tcp"])
def test_driver_heats_through_either_protocol(option):
    profile = load_profile("sma-reference")
    with served(option, "127.0.0.1:0") as (process, url):
        with open_transport(url + PATIENT, profile.serial_settings()) as transport:
            board = Heater(
                HeaterBoard(Device(profile, ModbusClient(transport)), MonotonicClock()),
                HeaterLimits(0.6, 130.0),
                MonotonicClock(),
            )
            board.connect()
            board.arm(5.0)
            board.exchange(0.4)
            assert board.exchange(0.4).armed
            board.enter_safe_state()
        process.send_signal(signal.SIGTERM)
        assert process.wait(300) == 0
        assert [line.split(" s ")[1] for line in process.stderr.read().splitlines()] == [
            "armed, watchdog 5.000 s",
            "disarmed",
            "heater off, end",
        ]


@pytest.mark.parametrize(
    ("options", "names"),
    [
        (["--tcp", "host"], ("'host'", "HOST:PORT")),
        (["--tcp", "70000"], ("'70000'", "HOST:PORT")),
        (["--rtu-tcp", "192.0.2.1:0"], ("--rtu-tcp 192.0.2.1:0: ",)),
        (["--tcp", "0", "--pty", "/nowhere/wire"], ("--pty, --tcp and --rtu-tcp",)),
        (["--profile", "adam-6018"], ("'adam-6018'", "--tcp HOST:PORT")),
    ],
)
def test_wrong_option_is_rejected_in_one_line(options, names):
    run = programs.run([*COMMAND, SIM, *options], capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL)
    assert run.returncode == 2
    assert all(name in run.stderr for name in names)
    assert run.stderr.count("\n") == 1


def connected(url, count):
    """`count` clients, in the order in which they connected."""
    address = re.fullmatch(r"tcp://(127\.0\.0\.1):(\d+)", url)
    return [socket.create_connection((address[1], int(address[2])), 5.0) for _ in range(count)]


def is_served(client):
    """Return True if a client gets a reply, and False if its connection was closed."""
    client.settimeout(5.0)
    try:
        client.sendall(mbap.seal(1, 1, READ))
        return bool(client.recv(256))
    except ConnectionError:
        return False


def test_clients_beyond_the_limit_are_rejected_and_logged_once():
    with contextlib.ExitStack() as stack:
        process, url = stack.enter_context(served("--tcp", "0", "--profile", "adam-6018"))
        clients = [stack.enter_context(client) for client in connected(url, MAX_CLIENTS + 20)]
        assert [is_served(client) for client in clients] == [True] * MAX_CLIENTS + [False] * 20
        clients[0].close()
        assert is_served(clients[1])
        assert is_served(stack.enter_context(connected(url, 1)[0]))
        process.send_signal(signal.SIGTERM)
        assert process.wait(10) == 0
        assert sum("clients are rejected" in line for line in process.stderr.read().splitlines()) == 1


def test_simulator_without_descriptors_goes_on_serving_its_clients():
    with contextlib.ExitStack() as stack:
        process, url = stack.enter_context(served("--tcp", "0", "--profile", "adam-6018"))
        resource.prlimit(process.pid, resource.RLIMIT_NOFILE, (40, 40))
        clients = [stack.enter_context(client) for client in connected(url, 50)]
        were_served = [is_served(client) for client in clients]
        assert were_served[:10] == [True] * 10
        assert were_served[-5:] == [False] * 5
        assert is_served(clients[0])
        process.send_signal(signal.SIGTERM)
        assert process.wait(10) == 0
        assert sum("clients are rejected" in line for line in process.stderr.read().splitlines()) == 1


def test_simulator_serves_descriptors_beyond_the_limit_of_select():
    """`select` accepts no descriptor from 1024 on. Here other files use the first thousand descriptors."""
    with contextlib.ExitStack() as stack:
        taken = [os.open(os.devnull, os.O_RDONLY) for _ in range(1024)]
        stack.callback(lambda: [os.close(descriptor) for descriptor in taken])
        near, far = os.pipe()
        stack.callback(os.close, near)
        os.write(far, b"x")
        assert near > 1023
        assert readable([near], 0.0) == [near]
        os.close(far)
