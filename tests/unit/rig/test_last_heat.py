"""The heat of the last run is known to the next driver of the same heat source, and to no other."""

import os
import time

import pytest

from smadrive.clock import MonotonicClock, VirtualClock
from smadrive.devices.state.folder import state_dir
from smadrive.devices.state.key import DeviceKey
from smadrive.rig import last_heat
from smadrive.rig.last_heat import KEPT_S, LastHeat
from smadrive.safety.bounding_wire import Shown
from smadrive.safety.temperature_band import Heated

CLOCK = MonotonicClock()
KEY = DeviceKey(frozenset({"/dev/serial/by-id/usb-1a86"}), 1, "77", port="serial:///dev/ttyUSB0")


def heated(time_s=None):
    wires = Shown(61.5, 60.25, 0.125), Shown(70.0, 66.0, 0.0), Shown(75.0, 68.0, 0.0)
    return Heated(CLOCK.now_s() if time_s is None else time_s, wires, Shown(140.0, 139.0))


def record():
    (file,) = state_dir().glob("heat-*.json")
    return file


def test_next_driver_of_the_heat_source_knows_the_heat():
    kept = heated()
    LastHeat(KEY, CLOCK).keep(kept)
    assert LastHeat(KEY, CLOCK).read() == kept
    others = DeviceKey(KEY.names, 2, "77"), DeviceKey(KEY.names, 1, "78"), DeviceKey(frozenset({"tcp://a:1"}), 1, "77")
    for other in others:
        assert LastHeat(other, CLOCK).read() is None


@pytest.mark.parametrize(("key", "clock"), [(None, CLOCK), (KEY, VirtualClock())])
def test_heat_of_a_simulated_device_is_known_in_this_process_only(key, clock):
    last, kept = LastHeat(key, clock), heated(0.0)
    last.keep(kept)
    assert last.read() == kept
    assert LastHeat(key, clock).read() is None
    assert not state_dir().exists()


@pytest.mark.parametrize("age_s", [-1e6, 2 * KEPT_S])
def test_record_of_another_time_is_ignored(age_s):
    LastHeat(KEY, CLOCK).keep(heated(CLOCK.now_s() - age_s))
    assert LastHeat(KEY, CLOCK).read() is None


def test_record_of_the_time_before_a_restart_of_the_machine_is_ignored(monkeypatch, tmp_path):
    LastHeat(KEY, CLOCK).keep(heated())
    monkeypatch.setattr(last_heat, "BOOT_ID", tmp_path / "another")
    (tmp_path / "another").write_text("6f0b2f6e")
    assert LastHeat(KEY, CLOCK).read() is None


@pytest.mark.parametrize("names", [("tcp://bench:502", "tcp://10.0.0.5:502"), ("/dev/wire", "usb 1-2")])
def test_port_is_found_under_one_of_its_names(names):
    kept = heated()
    LastHeat(DeviceKey(frozenset(names), 1), CLOCK).keep(kept)
    assert LastHeat(DeviceKey(frozenset(names[1:]), 1), CLOCK).read() == kept


def test_link_to_another_pseudo_terminal_leads_to_another_device():
    first, second = (
        DeviceKey(frozenset({"/bench/wire", f"/dev/pts/3 of {time_ns}"}), 1, port="serial:///dev/pts/3")
        for time_ns in (17, 18)
    )
    LastHeat(first, CLOCK).keep(heated())
    assert LastHeat(second, CLOCK).read() is None


def test_latest_of_several_records_counts():
    early, late = heated(), heated()
    for names, kept in ((["tcp://a:1", "tcp://b:1"], late), (["tcp://b:1", "tcp://c:1"], early)):
        LastHeat(DeviceKey(frozenset(names), 1, port=names[0]), CLOCK).keep(kept)
    assert LastHeat(DeviceKey(frozenset({"tcp://b:1"}), 1, port="tcp://b:1"), CLOCK).read() == late


def test_heat_of_a_run_that_failed_is_kept():
    kept = heated()
    with pytest.raises(ZeroDivisionError), LastHeat(KEY, CLOCK).kept(lambda: kept):
        raise ZeroDivisionError
    assert LastHeat(KEY, CLOCK).read() == kept


@pytest.mark.parametrize(
    "spoil",
    [
        lambda file: file.write_text("{"),
        lambda file: file.write_text(file.read_text().replace("61.5", "NaN")),  # no reading would be above it
        os.unlink,
        lambda file: (file.unlink(), os.mkfifo(file)),
    ],
)
def test_record_that_cannot_be_read_is_no_record(spoil):
    LastHeat(KEY, CLOCK).keep(heated())
    spoil(record())
    assert LastHeat(KEY, CLOCK).read() is None


def test_heat_that_cannot_be_written_is_known_in_this_process(state_home):
    (state_home / "smadrive").write_text("a file where the folder should be")
    last, kept = LastHeat(KEY, CLOCK), heated()
    last.keep(kept)
    assert last.read() == kept


def test_old_records_are_removed():
    LastHeat(KEY, CLOCK).keep(heated())
    old_s = time.time() - KEPT_S - 60.0
    os.utime(record(), (old_s, old_s))
    other = DeviceKey(KEY.names, 2)
    LastHeat(other, CLOCK).keep(heated())
    assert record().name == f"heat-{other.digest}.json"


def test_old_record_that_cannot_be_removed_prevents_no_new_one():
    kept, folder, old_s = heated(), state_dir() / "heat-0.json", time.time() - KEPT_S - 60.0
    folder.mkdir(parents=True)
    os.utime(folder, (old_s, old_s))
    LastHeat(KEY, CLOCK).keep(kept)
    assert LastHeat(KEY, CLOCK).read() == kept
