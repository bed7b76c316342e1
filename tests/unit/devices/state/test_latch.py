"""A trip stays latched until it is cleared."""

import os
from urllib.parse import quote

import pytest

from smadrive.devices.profile.profile import load_profile
from smadrive.devices.state.key import DeviceKey, key_at
from smadrive.devices.state.latch import TripLatch
from smadrive.errors import SafetyError, TripError

TRIP = TripError("fault 8: reads too cold; is the bead tight?", 8)
KEY = DeviceKey(frozenset({"/dev/serial/by-id/usb-1a86"}), 1, port="serial:///dev/ttyUSB0")


@pytest.fixture
def records(state_home):
    """The folder of the records, which exists after the first trip."""
    return state_home / "smadrive"


def test_trip_is_latched_for_a_new_process():
    TripLatch(KEY).latch(TRIP)
    assert TripLatch(KEY).read() == str(TRIP)


def test_clear_holds_for_all_processes():
    TripLatch(KEY).latch(TRIP)
    TripLatch(KEY).clear()
    assert TripLatch(KEY).read() is None
    TripLatch(KEY).clear()


def test_each_heater_has_its_own_latch():
    other = DeviceKey(frozenset({"tcp://127.0.0.1:502"}), 1)
    TripLatch(KEY).latch(TRIP)
    assert TripLatch(other).read() is None
    TripLatch(other).clear()
    assert TripLatch(KEY).read() == str(TRIP)


def test_a_trip_follows_the_serial_number_to_another_port():
    TripLatch(DeviceKey(KEY.names, 1, "77")).latch(TRIP)
    moved = TripLatch(DeviceKey(frozenset({"tcp://gateway:502"}), 5, "77"))
    assert moved.read() == str(TRIP)
    moved.clear()
    assert TripLatch(DeviceKey(KEY.names, 1, "77")).read() is None


def test_a_twin_at_the_same_port_is_not_tripped():
    TripLatch(DeviceKey(KEY.names, 1, "77")).latch(TRIP)
    assert TripLatch(DeviceKey(KEY.names, 1, "78")).read() is None


def test_trip_of_a_simulated_source_ends_with_the_process(state_home):
    latch = TripLatch(None)
    latch.latch(TRIP)
    assert latch.read() == str(TRIP)
    assert TripLatch(None).read() is None
    assert not list(state_home.iterdir())


def test_unreadable_file_counts_as_a_trip(state_home):
    TripLatch(KEY).latch(TRIP)
    file = next((state_home / "smadrive").iterdir())
    file.write_bytes(b"\xff\xfe")
    assert "cannot be read" in TripLatch(KEY).read()


@pytest.mark.parametrize("make", [os.mkdir, os.mkfifo])
def test_record_that_is_no_file_counts_until_it_is_removed(state_home, make):
    TripLatch(KEY).latch(TRIP)
    file = next((state_home / "smadrive").iterdir())
    file.unlink()
    make(file)
    latch = TripLatch(KEY)
    assert "a trip of unknown cause" in latch.read()
    if file.is_dir():
        with pytest.raises(SafetyError) as error:
            latch.clear()
        assert (error.value.where, error.value.value) == (str(file), "Is a directory")
        assert "a trip of unknown cause" in latch.read()
        file.rmdir()
    latch.clear()
    assert latch.read() is None


def test_unreadable_record_counts_for_every_device(records):
    TripLatch(KEY).latch(TRIP)
    next(records.iterdir()).write_text("{")
    other = TripLatch(DeviceKey(frozenset({"tcp://127.0.0.1:502"}), 1, "5"))
    assert "a trip of unknown cause" in other.read()
    other.clear()
    assert not list(records.iterdir())


def old_record(records, address, text="fault 8\n"):
    """Write a record in the form of version 0.1."""
    records.mkdir(exist_ok=True)
    file = records / f"{quote(address, safe='')}.tripped"
    file.write_text(text)
    return file


@pytest.mark.parametrize(
    "address",
    ["serial:///dev/serial/by-id/usb-1a86", "serial:///dev/ttyUSB0", "serial:///dev/serial/by-id/usb-1a86 unit 1"],
)
def test_a_record_of_0_1_is_honoured_once_and_then_belongs_to_the_device_that_is_there(records, monkeypatch, address):
    old = old_record(records, address)
    monkeypatch.setattr("smadrive.devices.state.latch.BY_ID", "/dev/serial/by-id")
    assert TripLatch(DeviceKey(KEY.names, 1, "77", KEY.port)).read() == "fault 8"
    assert not old.exists()
    assert TripLatch(DeviceKey(KEY.names, 1, "77")).read() == "fault 8"
    assert TripLatch(DeviceKey(KEY.names, 1, "78", KEY.port)).read() is None


def test_a_record_of_0_1_for_another_unit_does_not_count(records):
    old_record(records, "serial:///dev/ttyUSB0 unit 2")
    assert TripLatch(KEY).read() is None


def test_a_record_of_0_1_for_a_pseudo_terminal_that_is_gone_does_not_count(records):
    near, far = os.openpty()
    try:
        url = f"serial://{os.ttyname(far)}"
        old = old_record(records, url)
        key = key_at(url, load_profile("sma-reference"), None)
        os.utime(old, (0, 0))
        assert TripLatch(key).read() is None
        os.utime(old)
        assert TripLatch(key).read() == "fault 8"
    finally:
        os.close(near)
        os.close(far)


def test_an_empty_record_of_0_1_counts(records):
    old_record(records, KEY.port, "")
    assert "a trip of unknown cause" in TripLatch(KEY).read()
    TripLatch(KEY).clear()
    assert TripLatch(KEY).read() is None


def test_trip_that_cannot_be_written_holds_in_this_process(state_home):
    (state_home / "smadrive").write_text("a file where the folder should be")
    trip = TripError("fault 1", 1)
    latch = TripLatch(KEY)
    latch.latch(trip)
    assert latch.read() == "fault 1"
    (note,) = trip.__notes__
    assert str(state_home / "smadrive") in note


def test_a_folder_that_cannot_be_read_counts_as_a_trip(state_home):
    (state_home / "smadrive").write_text("a file where the folder should be")
    assert "a trip of unknown cause" in TripLatch(KEY).read()
    TripLatch(KEY).clear()
    assert TripLatch(KEY).read() is None


def test_a_user_without_a_home_has_no_trips(monkeypatch):
    monkeypatch.delenv("XDG_STATE_HOME")
    monkeypatch.delenv("HOME")
    monkeypatch.setattr("os.getuid", lambda: 54321)
    assert TripLatch(KEY).read() is None


def test_state_folder_with_too_long_a_name_counts_as_a_trip(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / ("x" * 300)))
    assert "a trip of unknown cause" in TripLatch(KEY).read()
