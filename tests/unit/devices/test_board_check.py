"""The check of a board on the desk: a right board passes, and each defect is found by its check."""

import re

import pytest
from marks import exhaustive

from firmware_sim.bench import SimulatedBench
from firmware_sim.board.library import missing_tool
from firmware_sim.config import load_sim
from firmware_sim.devices.board.firmware import BoardState
from smadrive.clock import VirtualClock
from smadrive.devices.board_check.check import check_board
from smadrive.devices.board_check.conformance_frames import CONFORMANCE
from smadrive.devices.board_check.result import CheckVerdict
from smadrive.devices.profile.profile import load_profile
from smadrive.errors import DeviceError, IdentityError, SafetyError
from smadrive.files.shipped import configs_dir
from smadrive.rig.ports.board_check import error_of
from smadrive.rig.ports.board_port import PROFILE

DOCUMENT = (configs_dir().parent / "docs" / "sma-reference.md").read_text(encoding="utf-8")


def board(implementation="python", profile="sma-reference"):
    config = load_sim("flexinol-lt-0.15mm")
    chosen = config.board.model_copy(update={"implementation": implementation})
    return SimulatedBench(config.model_copy(update={"board": chosen}), seed=1).attach(load_profile(profile))


def checked(device):
    """The verdicts of all checks by name, and the error that the command raises."""
    clock = VirtualClock()
    clock.follow(device.bench.advance_to)
    results = list(check_board(device.transport(clock), load_profile(PROFILE)))
    return {one.name: one.verdict for one in results}, error_of(results, "port")


def without_wire(device):
    device.bench.plant.faults.break_wire()
    return device


@pytest.mark.parametrize("implementation", ["python", exhaustive("native")])
def test_right_board_without_a_wire_passes_every_check(implementation):
    if implementation == "native" and missing_tool():
        pytest.skip("needs a C compiler and make (Debian packages gcc and make)")
    device = without_wire(board(implementation))
    verdicts, error = checked(device)
    assert set(verdicts.values()) == {CheckVerdict.PASSED}
    assert len(verdicts) == len(CONFORMANCE) + 7 + 11
    assert error is None
    assert device.firmware.current_a == 0.0


@pytest.mark.exhaustive
def test_check_that_needs_the_wire_away_is_skipped_with_one():
    device = board()
    verdicts, error = checked(device)
    assert [name for name, verdict in verdicts.items() if verdict is not CheckVerdict.PASSED] == [
        "an open heater is detected"
    ]
    assert verdicts["an open heater is detected"] is CheckVerdict.NOT_CHECKED
    assert error is None
    assert device.bench.plant.temperature_c < 30.0


@pytest.mark.exhaustive
def test_settings_of_the_board_are_as_before():
    device = without_wire(board())
    device.firmware.write({"watchdog_s": 1.5, "temperature_max": 120.0, "current_max": 0.4})
    checked(device)
    firmware = device.firmware
    assert (firmware.watchdog_s, firmware.temperature_max_c, firmware.current_max_a) == (1.5, 120.0, 0.4)
    assert (firmware.state, firmware.faults) == (BoardState.IDLE, 0)


def reads_feed(firmware):
    quantities = firmware.quantities

    def feeding():
        firmware._fed_ms = firmware._now_ms()
        return quantities()

    firmware.quantities = feeding


def repeats_feed(firmware):
    write = firmware.write

    def feeding(values):
        write(values)
        if "sequence" in values:
            firmware._fed_ms = firmware._now_ms()

    firmware.write = feeding


def watchdog_is_early(firmware):
    firmware._now_ms = lambda: round(2e3 * firmware.uptime_s)


def faults_do_not_latch(firmware):
    check_all = firmware._check_all

    def forgetting():
        firmware.faults = 0
        if firmware.state is BoardState.FAULT:
            firmware.state = BoardState.IDLE
        check_all()

    firmware._check_all = forgetting


def faults_clear_with_their_cause(firmware):
    trip = firmware._trip
    firmware._trip = lambda causes: trip(causes & ~0x02)


def current_max_is_ignored(firmware):
    set_current = firmware._set_current

    def unlimited():
        set_current()
        firmware.limits = 0

    firmware._set_current = unlimited


def broken_wire_is_ignored(firmware):
    trip = firmware._trip
    firmware._trip = lambda causes: trip(causes & ~0x40)


@pytest.mark.parametrize(
    ("spoil", "name"),
    [
        (reads_feed, "reads do not feed the watchdog"),
        exhaustive(repeats_feed, "a repeated sequence does not feed the watchdog"),
        exhaustive(watchdog_is_early, "reads do not feed the watchdog"),
        exhaustive(watchdog_is_early, "the clock of the board is right"),
        exhaustive(faults_do_not_latch, "a fault is latched and prevents arming"),
        exhaustive(faults_clear_with_their_cause, "a fault is cleared only without its cause"),
        exhaustive(current_max_is_ignored, "current_max holds the current back"),
        exhaustive(broken_wire_is_ignored, "an open heater is detected"),
    ],
)
def test_unsafe_firmware_fails_its_check(spoil, name):
    device = without_wire(board())
    spoil(device.firmware)
    verdicts, error = checked(device)
    assert verdicts[name] is CheckVerdict.FAILED
    assert isinstance(error, SafetyError)
    assert name in error.value


@pytest.mark.exhaustive
def test_converter_that_stands_still_fails_its_check():
    device = without_wire(board())
    device.bench.sensors.faults.stop_conversions()
    verdicts, error = checked(device)
    assert [name for name, verdict in verdicts.items() if verdict is CheckVerdict.FAILED] == [
        "the thermocouple is converted every 0.1 s"
    ]
    assert error.exit_code == 4


@pytest.mark.exhaustive
def test_wrong_reply_fails_its_conformance_frame():
    device = without_wire(board())
    device.responder._functions[4] = lambda _data: b"\x02\x00\x00"
    verdicts, error = checked(device)
    assert verdicts["a function that the board does not have"] is CheckVerdict.FAILED
    assert isinstance(error, DeviceError)
    assert error.exit_code == 3


@pytest.mark.exhaustive
def test_late_replies_fail_their_check():
    device = without_wire(board())
    device.faults.delay(0.1, for_s=1e6)
    verdicts, error = checked(device)
    assert verdicts["replies are in time"] is CheckVerdict.FAILED
    assert error is not None


@pytest.mark.parametrize("fault", ["open_thermocouple", "press_estop"])
def test_board_whose_fault_stays_is_not_checked(fault):
    device = board()
    device.bench.known_faults()[fault]()
    with pytest.raises(DeviceError) as error:
        checked(device)
    assert error.value.value in ("thermocouple_open", "estop")


def test_board_of_version_1_is_refused():
    with pytest.raises(IdentityError) as error:
        checked(board(profile="sma-reference:map_version=1"))
    assert error.value.value == "map_version = 1"


def test_conformance_frames_are_those_of_the_document():
    rows = re.findall(
        r"^\| ((?:[0-9A-F]{2} )+[0-9A-F]{2}) \| ((?:[0-9A-F]{2} ?)+) \| (.*?) \|$", DOCUMENT, re.MULTILINE
    )
    assert [tuple(frame) for frame in CONFORMANCE] == rows
