"""People and programs can read a trace."""

import resource

import pytest

from smadrive.clock import VirtualClock
from smadrive.errors import ConfigError, SmadriveError
from smadrive.modbus import pdu_description, requests
from smadrive.modbus.client import ModbusClient
from smadrive.modbus.framing import mbap, rtu
from smadrive.modbus.trace import TraceFile, content_of, read_trace
from smadrive.modbus.transports.in_process import InProcessTransport

READ = requests.read_holding(10, 2)
MASK_WRITE = bytes.fromhex("16 0004 FFFE 0001")
RIGHT = rtu.seal(1, bytes.fromhex("03 04 000A 000B"))


class NumberedReply:
    """Answers every Modbus TCP request with the payload of `RIGHT`."""

    def receive(self, data, time_s):
        return [(time_s, mbap.seal(mbap.Header.of(data).transaction, 1, RIGHT[1:-2]))]


def traced(path, far, baudrate, timing, runs):
    transport = InProcessTransport(far, VirtualClock(), baudrate)
    transport.clock.sleep_until(5.0)
    with TraceFile(path, transport) as trace:
        client = ModbusClient(transport, trace)
        transport.clock.sleep_until(6.0)
        for request in runs:
            try:
                client.execute(1, request, timing)
            except SmadriveError:
                continue
    return path.read_text(encoding="ascii").splitlines()


def test_trace_has_frames_and_their_meaning(tmp_path, script, timing):
    write = requests.write_register(32, 7)
    far = script(
        [(0.01, RIGHT[:4]), (0.02, RIGHT[4:])],
        [(0.0, RIGHT[:-1] + b"\0")],
        [(0.0, rtu.seal(1, b"\x86\x06"))],
        [(0.05, b"\x55\x55")],
    )
    lines = traced(tmp_path / "bus.trace", far, 115200, timing, [READ, READ, write, requests.read_input(5, 1)])
    assert lines == [
        "# smadrive bus trace 1: rtu, in process",
        "# seconds, > sent or < received or x discarded, the bytes, their meaning",
        "    1.000000 > 01 03 00 0A 00 02 E4 09 | unit 1: read 2 holding registers from 10",
        "    1.020000 < 01 03 04 00 0A 00 0B 9B F6 | unit 1: 10 11",
        "    1.021750 > 01 03 00 0A 00 02 E4 09 | unit 1: read 2 holding registers from 10",
        "    1.021750 < 01 03 04 00 0A 00 0B 9B 00 | no intact frame",
        "    1.121750 > 01 06 00 20 00 07 C9 C2 | unit 1: write register 32: 7",
        "    1.121750 < 01 86 06 C2 62 | unit 1: exception 6, device busy",
        "    1.123500 > 01 04 00 05 00 01 21 CB | unit 1: read 1 input registers from 5",
        "    1.173500 < 55 55 | no intact frame",
    ]


def test_unrequested_bytes_are_marked(tmp_path, script, timing):
    far = script([(0.0, RIGHT), (0.001, b"\x55")], [(0.0, RIGHT)])
    lines = traced(tmp_path / "bus.trace", far, 115200, timing, [READ, READ])
    assert [line[13:] for line in lines[4:6]] == ["x 55 | not requested", lines[2][13:]]


def test_modbus_tcp_is_traced_with_its_header(tmp_path, script, timing):
    lines = traced(tmp_path / "t", NumberedReply(), None, timing, [READ])
    assert lines[0] == "# smadrive bus trace 1: tcp, in process"
    assert lines[3].endswith(" 00 00 00 07 01 03 04 00 0A 00 0B | unit 1: 10 11")


def test_trace_reads_back_as_the_same_frames(tmp_path, script, timing):
    path = tmp_path / "bus.trace"
    traced(path, script([(0.02, RIGHT)]), 115200, timing, [READ, READ])
    numbered, lines = read_trace(path)
    assert not numbered
    assert [(line.direction, line.data) for line in lines] == [
        ("sent", rtu.seal(1, READ.pdu)),
        ("received", RIGHT),
        ("sent", rtu.seal(1, READ.pdu)),
    ]
    assert lines[1].time_s - lines[0].time_s == pytest.approx(0.02)
    assert content_of(RIGHT, numbered=False) == (1, RIGHT[1:-2])


@pytest.mark.parametrize(
    ("request_", "said"),
    [
        (requests.read_coils(0, 10), "read 10 coils from 0"),
        (requests.read_discrete(1, 2), "read 2 discrete inputs from 1"),
        (requests.read_input(1, 2), "read 2 input registers from 1"),
        (requests.write_coil(4, True), "write coil 4: on"),
        (requests.write_coils(4, [True, False, True]), "write coils from 4: 101"),
        (requests.write_registers(4, [1, 65535]), "write registers from 4: 1 65535"),
        (
            requests.Request(MASK_WRITE, MASK_WRITE, payload_size=0, writes=True),
            "mask register 4: and 0xfffe, or 0x0001",
        ),
        (requests.exchange(32, [1, 2], 16, 3), "write registers from 32: 1 2, read 3 from 16"),
    ],
)
def test_every_request_has_a_description(request_, said):
    assert pdu_description.of_request(request_.pdu) == said


def test_replies_and_malformed_frames_have_a_description():
    read = requests.read_coils(0, 3).pdu
    assert pdu_description.of_reply(bytes.fromhex("01 01 05"), read) == "101"
    assert pdu_description.of_reply(bytes.fromhex("81 02"), read) == "exception 2, illegal data address"
    assert pdu_description.of_reply(bytes.fromhex("04 02 0001"), read) == "a reply to function 4"
    assert pdu_description.of_reply(requests.write_register(1, 2).pdu, requests.write_register(1, 2).pdu) == "done"
    assert pdu_description.of_request(b"\x03\x00") == "malformed request"
    assert pdu_description.of_request(b"\x63\x00\x00\x00\x00") == "function 99"


@pytest.mark.parametrize(
    ("text", "place", "value"),
    [
        ("", "t", None),
        ("# smadrive bus trace 1: rtu\n0.1 > 01 0g", "t, line 2", "0.1 > 01 0g"),
        ("# smadrive bus trace 1: rtu\n# x\n0.1 ? 01", "t, line 3", "0.1 ? 01"),
        ("# smadrive bus trace 1: text, port", "t", "text"),
    ],
)
def test_file_that_is_no_trace_is_refused(tmp_path, text, place, value):
    path = tmp_path / "t"
    path.write_text(text, encoding="ascii")
    with pytest.raises(ConfigError) as error:
        read_trace(path)
    assert (error.value.where, error.value.value) == (f"{tmp_path}/{place}", value)


def test_trace_that_cannot_be_written_is_refused(tmp_path, script):
    with pytest.raises(ConfigError) as error:
        TraceFile(tmp_path / "no" / "t", InProcessTransport(script(), VirtualClock()))
    assert error.value.where == str(tmp_path / "no" / "t")


def test_full_disk_ends_only_the_trace(tmp_path, script, timing, caplog):
    """A limit of the file size takes the place of a full disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    far = script(*[[(0.0, RIGHT)]] * 50)
    transport = InProcessTransport(far, VirtualClock())
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, hard))
    try:
        with TraceFile(tmp_path / "bus.trace", transport) as trace:
            client = ModbusClient(transport, trace)
            for _ in range(50):
                client.execute(1, READ, timing)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert client.counters.replies == 50
    assert [record.levelname for record in caplog.records] == ["WARNING"]
    numbered, lines = read_trace(tmp_path / "bus.trace")
    assert not numbered
    assert 0 < len(lines) < 100
