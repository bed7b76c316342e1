"""The key of a device, with permanent names and serial number, and the table that tells when a trip applies."""

import os
import threading
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import pytest
from waiting import wait_for

from smadrive.devices.profile.profile import load_profile
from smadrive.devices.state import key as keys
from smadrive.devices.state.key import APPLIES, DeviceKey, Match, key_at, port_names, serial_number
from smadrive.errors import ConfigError
from smadrive.modbus.transports import host_names

PORTS = {Match.SAME: {"usb-1"}, Match.DIFFERENT: {"usb-2"}, Match.UNKNOWN: set()}
SERIALS = {Match.SAME: "77", Match.DIFFERENT: "78", Match.UNKNOWN: None}
TRIPPED = DeviceKey(frozenset({"usb-1"}), 1, "77")


@pytest.mark.parametrize("port", Match)
@pytest.mark.parametrize("serial", Match)
def test_every_cell_of_the_table(port, serial):
    here = DeviceKey(frozenset(PORTS[port]), 1, SERIALS[serial])
    assert (TRIPPED.port_match(here), TRIPPED.serial_match(here)) == (port, serial)
    says_same = Match.SAME in (port, serial)
    nothing_known = port is serial is Match.UNKNOWN
    assert TRIPPED.applies_to(here) == ((says_same or nothing_known) and serial is not Match.DIFFERENT)
    assert here.applies_to(TRIPPED) == TRIPPED.applies_to(here)
    assert TRIPPED.proves(here) == (serial is Match.SAME)


def test_the_table_has_every_cell():
    assert set(APPLIES) == {(port, serial) for port in Match for serial in Match}


@pytest.mark.parametrize("port", Match)
def test_a_device_without_a_serial_number_is_proved_by_its_port(port):
    one, other = DeviceKey(TRIPPED.names, 1), DeviceKey(frozenset(PORTS[port]), 1)
    assert one.proves(other) == (port is Match.SAME)


@pytest.mark.parametrize(("other", "is_proved"), [("sma-reference", False), ("riden-rd60xx", True), (None, True)])
def test_same_serial_number_proves_no_device_of_another_type(other, is_proved):
    riden = key_at("serial:///dev/ttyS0", load_profile("riden-rd60xx"), 1)
    riden = riden.with_identity(load_profile("riden-rd60xx:model_id=60121"), {"model_id": 60121, "serial_number": 77})
    assert riden.type_id == "riden-rd60xx"
    here = replace(TRIPPED, type_id=other)
    assert (riden.proves(here), here.proves(riden)) == (is_proved, is_proved)
    assert here.applies_to(riden)


def test_another_unit_of_the_same_port_is_another_device():
    assert TRIPPED.port_match(DeviceKey(TRIPPED.names, 2)) is Match.DIFFERENT


@pytest.fixture
def udev(tmp_path, monkeypatch):
    """Return `plug(number, by_id, by_path)`, which adds an adapter with this port number and these links."""
    folders = {"BY_ID": tmp_path / "by-id", "BY_PATH": tmp_path / "by-path"}
    for name, folder in folders.items():
        folder.mkdir()
        monkeypatch.setattr(keys, name, folder)

    def plug(number, by_id, by_path):
        port = tmp_path / f"ttyUSB{number}"
        port.touch()
        for folder, link in zip(folders.values(), (by_id, by_path), strict=True):
            if link is not None:
                (folder / link).unlink(missing_ok=True)
                (folder / link).symlink_to(port)
        return port

    return plug


def test_an_adapter_is_known_by_its_links_whatever_the_rig_file_says(udev, tmp_path):
    port = udev(0, "usb-1a86", "pci-1")
    (tmp_path / "rig").symlink_to(port)
    by_id, by_path = str(tmp_path / "by-id" / "usb-1a86"), str(tmp_path / "by-path" / "pci-1")
    for path in (port, by_id, by_path, f"{tmp_path}/./ttyUSB0?baudrate=9600"):
        assert port_names(f"serial://{path}") == {by_id, by_path}
    assert port_names(f"serial://{tmp_path}/rig") == {by_id, by_path, str(tmp_path / "rig")}


def test_an_adapter_that_comes_back_under_another_number_is_the_same(udev):
    before = port_names(f"serial://{udev(0, 'usb-1a86', 'pci-1')}")
    assert port_names(f"serial://{udev(3, 'usb-1a86', 'pci-2')}") & before
    assert port_names(f"serial://{udev(4, 'usb-cafe', 'pci-1')}") & before
    assert not port_names(f"serial://{udev(5, 'usb-cafe', 'pci-2')}") & before


def test_kernel_number_is_not_a_permanent_name(udev):
    assert port_names(f"serial://{udev(0, None, None)}") == frozenset()


def test_a_link_whose_adapter_is_unplugged_still_names_it(udev, tmp_path):
    udev(0, "usb-1a86", "pci-1").unlink()
    link = tmp_path / "by-id" / "usb-1a86"
    assert str(link) in port_names(f"serial://{link}")


def created_now_ns() -> int:
    """Return the time at which the kernel says that a pseudo-terminal of this moment was created."""
    near, far = os.openpty()
    created_ns = os.fstat(far).st_ctime_ns
    os.close(near)
    os.close(far)
    return created_ns


def test_a_pseudo_terminal_is_known_by_its_number_only_while_it_exists():
    near, far = os.openpty()
    path = os.ttyname(far)
    created_ns = os.fstat(far).st_ctime_ns
    before = port_names(f"serial://{path}")
    assert before == port_names(f"serial://{path}")
    os.close(near)
    os.close(far)
    # the clock of the kernel's files moves in ticks, and a busy machine delays them
    wait_for(lambda: created_now_ns() != created_ns)
    with ExitStack() as stack:
        while not Path(path).exists():  # another program may get the number meanwhile
            for end in os.openpty():
                stack.callback(os.close, end)
        after = port_names(f"serial://{path}")
    assert before
    assert after
    assert not before & after


def test_an_on_board_port_is_known_by_its_path(tmp_path):
    assert port_names(f"serial://{tmp_path}/ttyS0") == {f"{tmp_path}/ttyS0"}


def test_a_network_device_is_known_by_host_port_and_unit():
    profile = load_profile("riden-rd60xx")
    one = key_at("rtu+tcp://Bench:502", profile, None)
    assert one == key_at("tcp://bench/?latency_ms=5", profile, 1)
    assert one.port_match(key_at("tcp://bench:502", profile, 2)) is Match.DIFFERENT


SPELLED = ["localhost", "LocalHost.", "127.1", "[::ffff:127.0.0.1]", "0"]


@pytest.mark.parametrize("host", SPELLED)
def test_port_is_the_same_under_each_name_of_its_host(host):
    here, there = (DeviceKey(port_names(f"tcp://{one}:502"), 1) for one in ("127.0.0.1", host))
    assert here.port_match(there) is Match.SAME
    assert here.proves(there)
    assert here.applies_to(there)
    assert here.port_match(DeviceKey(port_names(f"tcp://{host}:503"), 1)) is Match.DIFFERENT


UNKNOWN_HOST = "no-such-host.invalid"


def test_failed_look_up_leaves_it_open_whether_two_ports_are_one():
    lost = DeviceKey(port_names(f"tcp://{UNKNOWN_HOST}:502"), 1)
    assert lost.port_match(DeviceKey(port_names("tcp://127.0.0.1:502"), 1)) is Match.UNKNOWN
    assert lost.port_match(DeviceKey(port_names(f"rtu+tcp://{UNKNOWN_HOST}.:502"), 1)) is Match.SAME
    assert lost.port_match(DeviceKey(port_names("tcp://127.0.0.1:503"), 1)) is Match.DIFFERENT
    assert lost.port_match(DeviceKey(frozenset({"/dev/ttyS0"}), 1)) is Match.DIFFERENT


def test_look_up_that_does_not_end_counts_as_failed(monkeypatch):
    ends = threading.Event()
    monkeypatch.setattr(host_names, "LOOK_UP_WITHIN_S", 0.01)
    monkeypatch.setattr("socket.getaddrinfo", lambda *_, **__: ends.wait(60.0) and [])
    assert port_names("tcp://bench:502") == {"tcp://bench:502"}
    ends.set()


def test_a_url_that_names_no_port_is_refused():
    with pytest.raises(ConfigError):
        key_at("serial://ttyUSB0", load_profile("riden-rd60xx"), None)


@pytest.mark.parametrize(
    ("profile", "identity", "number"),
    [
        ("riden-rd60xx", {"model_id": 60121, "serial_number": 77}, "77"),
        ("sma-reference", {"device_id": 0x534D, "map_version": 1, "serial_number": 5}, "5"),
        ("riden-rd60xx", {"model_id": 60121, "serial_number": 0}, None),
        ("riden-rd60xx", {"model_id": 60121, "serial_number": 0xFFFFFFFF}, None),
        ("riden-rd60xx", {}, None),
        ("xy-sk-family", {"model_id": 22873}, None),
        ("tclab", {}, None),
    ],
)
def test_serial_number_is_the_identify_register_without_ranges(profile, identity, number):
    assert serial_number(load_profile(profile), identity) == number
