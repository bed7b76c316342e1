"""URLs and serial ports. A pseudo-terminal takes the place of the port."""

import grp
import os
from contextlib import ExitStack
from pathlib import Path

import pytest

from smadrive.errors import ConfigError, TakenOverError, TransportError
from smadrive.modbus.transports.connect import open_transport, port_of
from smadrive.modbus.transports.transport import SerialSettings


@pytest.fixture
def terminal():
    near, far = os.openpty()
    path = os.ttyname(far)
    os.close(far)
    yield near, path
    os.close(near)


SCHEMES = "serial:///dev/ttyUSB0, tcp://host:502 or rtu+tcp://host:port"


@pytest.mark.parametrize(
    ("url", "value", "cure"),
    [
        ("/dev/ttyUSB0", None, "write serial:///dev/ttyUSB0"),
        ("udp://host:502", "udp", SCHEMES),
        ("tcp://", None, "tcp://192.168.1.10:502"),
        ("tcp://host:x", None, "tcp://192.168.1.10:502"),
        ("tcp://host:502/unit", None, "tcp://192.168.1.10:502"),
        ("rtu+tcp://host", None, "rtu+tcp://192.168.1.10:502"),
        ("tcp://host?baudrate=9600", "baudrate=9600", "allowed are latency_ms=<0 to 5000>"),
        ("rtu+tcp://host:4001?parity=E", "parity=E", "allowed are baudrate="),
        ("serial://dev/ttyUSB0", None, "three slashes"),
        ("serial:///", None, "three slashes"),
        ("serial:///dev/x?baud=9600", "baud=9600", "allowed are baudrate="),
        ("serial:///dev/x?baudrate=fast", "baudrate=fast", "baudrate=<50 to 12000000>"),
        ("serial:///dev/x?baudrate=0", "baudrate=0", "baudrate=<50 to 12000000>"),
        ("serial:///dev/x?parity=even", "parity=even", "parity=N|E|O"),
        ("serial:///dev/x?stopbits=3", "stopbits=3", "stopbits=1|2"),
        ("serial:///dev/x?latency_ms=5001", "latency_ms=5001", "latency_ms=<0 to 5000>"),
        ("tcp://host?latency_ms=-1", "latency_ms=-1", "latency_ms=<0 to 5000>"),
    ],
)
def test_malformed_url_is_refused(url, value, cure):
    with pytest.raises(ConfigError) as error:
        open_transport(url)
    assert url in error.value.where
    assert (error.value.value or "").strip("'") == (value or "")
    assert cure in error.value.cure


def test_missing_port_is_refused_with_the_ports_present():
    with pytest.raises(TransportError) as error:
        open_transport("serial:///dev/ttyNone")
    assert error.value.where == "/dev/ttyNone"
    assert error.value.value.startswith("serial ports present: ")
    assert "/dev/serial/by-id" in error.value.cure


def test_forbidden_port_is_refused_with_the_group_to_join(terminal):
    _, path = terminal
    Path(path).chmod(0)
    group = grp.getgrgid(Path(path).stat().st_gid).gr_name
    is_root = os.geteuid() == 0
    if is_root:
        os.seteuid(65534)  # root may open every port
    try:
        with pytest.raises(TransportError) as error:
            open_transport(f"serial://{path}")
    finally:
        if is_root:
            os.seteuid(0)
    assert error.value.where == path
    assert f"sudo usermod -aG {group} $USER" in error.value.cure


def test_a_forked_child_does_not_keep_the_port_locked(terminal):
    """The child shares the open port and its lock, as a duplicated descriptor does."""
    _, path = terminal
    transport = open_transport(f"serial://{path}")
    shared = os.dup(transport._descriptor)
    transport.close()
    open_transport(f"serial://{path}").close()
    os.close(shared)


def test_a_pseudo_terminal_has_no_parity_and_is_opened_again_and_again(terminal):
    _, path = terminal
    for parity in ("E", "E", "O", "N", "E"):
        with open_transport(f"serial://{path}?parity={parity}") as transport:
            transport.write(b"x")


def test_a_file_is_no_port(tmp_path):
    file = tmp_path / "file"
    file.touch()
    with pytest.raises(TransportError) as error:
        open_transport(f"serial://{file}")
    assert error.value.where == str(file)


def test_a_port_in_use_is_refused_and_free_again_after_close(terminal):
    _, path = terminal
    with (
        open_transport(f"serial://{path}"),
        pytest.raises(TransportError) as error,
    ):
        open_transport(f"serial://{path}")
    assert f"process {os.getpid()}" in error.value.what
    assert all(way in error.value.cure for way in ("Ctrl-C", f"`kill {os.getpid()}`", "smadrive off"))
    open_transport(f"serial://{path}").close()


def test_the_url_overrules_the_defaults(terminal):
    _, path = terminal
    defaults = SerialSettings(baudrate=9600, stopbits=2)
    with open_transport(f"serial://{path}", defaults) as transport:
        assert transport.baudrate == 9600
    with open_transport(f"serial://{path}?baudrate=57600&parity=E&stopbits=1", defaults) as transport:
        assert transport.baudrate == 57600


def test_bytes_pass_both_ways_and_can_be_discarded(terminal):
    near, path = terminal
    with open_transport(f"serial://{path}") as transport:
        transport.write(b"\x01\x03\x0a\x0d\x11")
        assert os.read(near, 100) == b"\x01\x03\x0a\x0d\x11"
        os.write(near, b"\x0a\x0d\x00\xff")
        assert transport.read(transport.clock.now_s() + 5) == b"\x0a\x0d\x00\xff"
        assert transport.read(transport.clock.now_s()) == b""
        assert transport.discard() == b""
        os.write(near, b"xyz")
        assert transport.read(transport.clock.now_s() + 5) == b"xyz"


def test_a_vanished_port_is_a_lost_connection():
    near, far = os.openpty()
    with open_transport(f"serial://{os.ttyname(far)}") as transport:
        os.close(far)
        os.close(near)
        with pytest.raises(TransportError) as error:
            transport.read(transport.clock.now_s() + 5)
        assert "plugged in" in error.value.cure
        assert transport.lost
        with pytest.raises(TransportError):
            transport.write(b"x")


@pytest.mark.parametrize("links", [0, 1, 2])
def test_an_ended_pseudo_terminal_is_not_opened_again_when_another_one_has_its_number(links, tmp_path):
    near, far = os.openpty()
    name = path = os.ttyname(far)
    for number in range(links):
        link = tmp_path / f"link{number}"
        link.symlink_to(path)
        path = str(link)
    with ExitStack() as stack, open_transport(f"serial://{path}") as transport:
        os.close(far)
        os.close(near)
        with pytest.raises(TransportError):
            transport.write(b"x")
        while not Path(name).exists():
            for end in os.openpty():
                stack.callback(os.close, end)
        with pytest.raises(TransportError) as error:
            transport.reopen(transport.clock.now_s() + 5)
        assert "new pseudo-terminal" in error.value.cure
        assert transport.lost


def test_a_port_that_has_come_back_is_opened_again_but_not_one_that_was_closed(terminal, tmp_path):
    link = tmp_path / "port"
    near, far = os.openpty()
    link.symlink_to(os.ttyname(far))
    with open_transport(f"serial://{link}") as transport:
        os.close(far)
        os.close(near)
        with pytest.raises(TransportError):
            transport.write(b"x")
        assert transport.lost
        link.unlink()
        with pytest.raises(TransportError) as error:
            transport.reopen(transport.clock.now_s())
        assert error.value.value.startswith("serial ports present: ")
        link.symlink_to(terminal[1])
        transport.reopen(transport.clock.now_s())
        transport.write(b"x")
        assert os.read(terminal[0], 10) == b"x"
    with pytest.raises(TransportError) as closed:
        transport.reopen(transport.clock.now_s())
    assert closed.value.cure == "open a new connection"


def test_closed_port_is_a_lost_connection_and_may_be_closed_again(terminal):
    transport = open_transport(f"serial://{terminal[1]}")
    transport.close()
    transport.close()
    for use in (lambda: transport.write(b"x"), transport.discard, lambda: transport.read(transport.clock.now_s())):
        with pytest.raises(TransportError):
            use()
        assert transport.lost


def test_lost_port_access_sends_and_returns_nothing(terminal):
    """The transport loses its access to the port once during the wait for an answer, and once before the request."""
    asked = []

    def port_access():
        asked.append(len(asked))
        if len(asked) > 2:
            raise TakenOverError("the guardian has the line")

    near, path = terminal
    with open_transport(f"serial://{path}", port_access=port_access) as transport:
        transport.write(b"x")
        assert os.read(near, 10) == b"x"
        os.write(near, b"the answer to another's question")
        with pytest.raises(TakenOverError):
            transport.read(transport.clock.now_s() + 1.0)
        for use in (lambda: transport.write(b"y"), transport.discard, lambda: transport.reopen(0.0)):
            with pytest.raises(TakenOverError):
                use()
        os.set_blocking(near, False)
        with pytest.raises(BlockingIOError):
            os.read(near, 10)


def test_a_port_is_the_same_however_it_is_spelled(tmp_path):
    port = tmp_path / "ttyUSB0"
    port.touch()
    (tmp_path / "link").symlink_to(port)
    spelled = (f"{tmp_path}/./ttyUSB0", f"{tmp_path}//ttyUSB0?baudrate=9600", f"{tmp_path}/link")
    assert {port_of(f"serial://{path}") for path in spelled} == {f"serial://{port}"}


def test_a_host_is_the_same_however_it_is_spelled():
    spelled = ("tcp://Bench", "tcp://bench:502", "tcp://BENCH/?latency_ms=5", "rtu+tcp://bench:502")
    assert {port_of(url) for url in spelled} == {"tcp://bench:502"}
    assert port_of("tcp://bench:503") == "tcp://bench:503"


@pytest.mark.parametrize(
    ("given", "cure"),
    [
        ("/dev/ttyUSB7", "write serial:///dev/ttyUSB7"),
        ("COM3", "smadrive opens ports on Linux and macOS only"),
        ("tuned.toml", "a config file is given; give the port"),
    ],
)
def test_text_without_a_scheme_has_the_cure_for_its_kind(given, cure):
    with pytest.raises(ConfigError) as error:
        port_of(given)
    assert error.value.cure.startswith(cure)
