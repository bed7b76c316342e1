"""Third-party Modbus: other clients read and write the simulator, and the driver uses another server."""

import re
import shutil
import subprocess

import minimalmodbus
import pytest
from peers import libmodbus
from pymodbus.client import ModbusSerialClient, ModbusTcpClient
from served import PATIENT, served

from smadrive.devices.device import Device
from smadrive.devices.profile.profile import Profile, load_profile
from smadrive.errors import ExceptionReply, IdentityError
from smadrive.modbus import requests
from smadrive.modbus.client import ModbusClient
from smadrive.modbus.transports.connect import open_transport

needs_libmodbus = pytest.mark.skipif(libmodbus.missing() is not None, reason=str(libmodbus.missing()))
needs_mbpoll = pytest.mark.skipif(shutil.which("mbpoll") is None, reason="needs mbpoll (Debian package mbpoll)")

BOARD = load_profile("sma-reference")
FIRST = 48  # watchdog, highest temperature, highest current: every client writes them and reads them back
WORDS = (700, 900, 4000)


@pytest.fixture(scope="module", params=["rtu", "tcp"])
def simulator(request):
    """The protocol, and the path or port of a simulated board."""
    with served(*([] if request.param == "rtu" else ["--tcp", "0"])) as (_, url):
        yield request.param, url.rpartition(":")[2] if request.param == "tcp" else url.removeprefix("serial://")


@pytest.fixture(autouse=True)
def other_words_before_each_test(request):
    """The three registers hold other words before each test that reads the words of a client."""
    if "simulator" not in request.fixturenames:
        return
    with open_board(*request.getfixturevalue("simulator")) as transport:
        ModbusClient(transport).execute(1, requests.write_registers(FIRST, (500, 1000, 5000)), BOARD.bus_timing())


def open_board(kind, where):
    return open_transport((f"tcp://127.0.0.1:{where}" if kind == "tcp" else f"serial://{where}") + PATIENT)


def read_by_the_driver(kind, where):
    with open_board(kind, where) as transport:
        return requests.registers_of(
            ModbusClient(transport).execute(1, requests.read_holding(FIRST, len(WORDS)), BOARD.bus_timing())
        )


@needs_libmodbus
def test_libmodbus_reads_and_writes_the_simulator(simulator):
    def client(*command):
        return [int(word) for word in libmodbus.client(*simulator, 1, *command)]

    assert client("read", 0, 2) == [0x534D, 2]
    client("write", FIRST, *WORDS)
    assert read_by_the_driver(*simulator) == WORDS
    client("write", FIRST, 800)
    assert client("read", FIRST, 3) == [800, *WORDS[1:]]
    echo, state = client("exchange", 32, 777, 0, 0, "/", 16, 2)
    assert (echo, state) == (777, 0)


@needs_libmodbus
def test_libmodbus_gets_the_exception_codes(simulator):
    for command, message in (
        (("read", 5, 1), "Illegal data address"),
        (("write", FIRST, 1), "Illegal data value"),
        (("write", 0, 1), "Illegal data address"),
    ):
        with pytest.raises(subprocess.CalledProcessError) as error:
            libmodbus.client(*simulator, 1, *command)
        assert message in error.value.stdout


@needs_mbpoll
@pytest.mark.exhaustive
def test_mbpoll_writes_and_reads_the_simulator(simulator):
    kind, where = simulator
    line = ["-m", "rtu", "-b115200", "-Pnone", where] if kind == "rtu" else ["-m", "tcp", "-p", where, "127.0.0.1"]
    common = ["mbpoll", "-a1", "-0", "-1", f"-r{FIRST}"]
    subprocess.run([*common, *line, *map(str, WORDS)], check=True, capture_output=True)
    assert read_by_the_driver(kind, where) == WORDS
    output = subprocess.run([*common, "-c3", *line], check=True, capture_output=True, text=True).stdout
    assert tuple(int(word) for word in re.findall(r"\[\d+\]:\s+(\d+)", output)) == WORDS


def test_pymodbus_reads_and_writes_the_simulator(simulator):
    kind, where = simulator
    client = (
        ModbusSerialClient(where, baudrate=115200) if kind == "rtu" else ModbusTcpClient("127.0.0.1", port=int(where))
    )
    with client:
        assert client.read_holding_registers(0, count=2, device_id=1).registers == [0x534D, 2]
        client.write_registers(FIRST, list(WORDS), device_id=1)
        assert client.read_holding_registers(FIRST, count=3, device_id=1).registers == list(WORDS)
        client.write_register(FIRST, 800, device_id=1)
        client.mask_write_register(address=FIRST, and_mask=0xFFFE, or_mask=1, device_id=1)
        exchanged = client.readwrite_registers(
            read_address=FIRST, read_count=3, write_address=FIRST + 1, values=[950], device_id=1
        )
        assert exchanged.registers == [801, 950, WORDS[2]]
        assert client.read_holding_registers(5, count=1, device_id=1).exception_code == 2
        assert client.diag_query_data(b"\x12\x34", device_id=1).message == b"\x12\x34"


@pytest.mark.parametrize("simulator", ["rtu"], indirect=True)
def test_minimalmodbus_reads_and_writes_the_simulator(simulator):
    instrument = minimalmodbus.Instrument(simulator[1], 1)
    instrument.serial.baudrate = 115200
    instrument.serial.timeout = 1.0
    with instrument.serial:
        assert instrument.read_registers(0, 2) == [0x534D, 2]
        instrument.write_registers(FIRST, list(WORDS))
        instrument.write_register(FIRST, 800, functioncode=6)
        assert instrument.read_registers(FIRST, 3) == [800, *WORDS[1:]]
        assert instrument.read_long(3) >= 0x8000_0000  # a simulated board has a random serial number
        with pytest.raises(minimalmodbus.IllegalRequestError):
            instrument.read_register(5)


FOREIGN = """
schema = 1
[profile]
id = "foreign"
role = "supply"
vendor = "somebody else"
{protocol}
[timing]
response_timeout_ms = 1000
max_write_registers = 10
[identify]
register = "model"
ranges = [[4711, 4711]]
[roles]
heater_current = "i_set"
heater_enable = "output"
measured_current = "i_out"
[registers.model]
table = "input"
address = 900
type = "uint16"
access = "r"
evidence = "two"
[registers.i_set]
table = "holding"
address = 0x20
type = "uint32"
word_order = "little"
scale = 0.0001
unit = "A"
access = "rw"
min = 0.0
max = 20.0
evidence = "two"
[registers.output]
table = "holding"
address = 0x30
type = "uint16"
enum = {{ 0 = "off", 165 = "on" }}
access = "rw"
evidence = "two"
[registers.i_out]
table = "holding"
address = 0x40
type = "float32"
word_order = "little"
unit = "A"
access = "r"
evidence = "two"
[[safe_state]]
register = "i_set"
value = 0
[[safe_state]]
register = "output"
value = 0
"""
LINES = {
    "rtu": "[serial]\nbaudrate = 115200\nunit_id = 7",
    "tcp": 'protocol = "modbus-tcp"\n[tcp]\nunit_id = 7',
}
CONTENT = ((900, 4711), (0x40, 0x0000), (0x41, 0x3FC0))  # 1.5 as float32, low word first


def foreign_profile(kind, tmp_path):
    path = tmp_path / "foreign.toml"
    path.write_text(FOREIGN.format(protocol=LINES[kind]), encoding="utf-8")
    return load_profile(str(path))


@needs_libmodbus
@pytest.mark.parametrize("kind", ["rtu", "tcp"])
def test_driver_drives_a_libmodbus_server_by_a_profile(kind, tmp_path):
    profile: Profile = foreign_profile(kind, tmp_path)
    with libmodbus.server(kind, 7, CONTENT) as where, open_board(kind, where) as transport:
        device = Device(profile, ModbusClient(transport))
        device.check_identity()
        device.write("i_set", 12.3456)
        device.write("output", 165)
        readings = device.read(("i_set", "output", "i_out"))
        assert readings["i_set"].value == pytest.approx(12.3456)
        assert readings["output"].words == ("on",)
        assert readings["i_out"].value == 1.5
        client = device.client
        timing = profile.bus_timing()
        assert requests.registers_of(client.execute(7, requests.read_holding(0x20, 2), timing)) == (0xE240, 0x0001)
        device.enter_safe_state()
        assert device.read(("i_set",))["i_set"].value == 0.0
        with pytest.raises(ExceptionReply) as error:
            client.execute(7, requests.read_holding(2000, 1), timing)
        assert error.value.code == 2


@needs_libmodbus
@pytest.mark.exhaustive
def test_libmodbus_server_with_another_identity_is_not_written(tmp_path):
    profile = foreign_profile("rtu", tmp_path)
    with libmodbus.server("rtu", 7, ((900, 4712),)) as where, open_board("rtu", where) as transport:
        device = Device(profile, ModbusClient(transport))
        with pytest.raises(IdentityError) as error:
            device.write("i_set", 1.0)
        assert "4712" in str(error.value)
        assert "4711" in str(error.value)
        words = device.client.execute(7, requests.read_holding(0x20, 2), profile.bus_timing())
        assert words == bytes(4)
