"""A device has one guardian, which is shown while it waits and relieved when the device is confirmed off."""

import os
from dataclasses import replace

import pytest

from smadrive.devices.guardian import duty as duties
from smadrive.devices.guardian.duty import HeldDuty, relieve, waiting_duties
from smadrive.devices.state.key import DeviceKey
from smadrive.errors import SafetyError

KEY = DeviceKey(frozenset({"tcp://gateway:502"}), 1, "77")
TWIN = DeviceKey(KEY.names, 1, "78")


@pytest.fixture(autouse=True)
def _soon(monkeypatch):
    monkeypatch.setattr(duties, "FREE_WITHIN_S", 0.1)


def test_only_a_guardian_that_waits_is_shown_and_only_while_it_lives():
    with HeldDuty.take("riden at gateway", KEY) as held:
        assert waiting_duties() == []
        held.wait("no answer")
        (duty,) = waiting_duties()
        assert (duty.key, duty.waiting, duty.device) == (KEY, "no answer", "riden at gateway")
        held.wait("busy")
        assert [duty.waiting for duty in waiting_duties()] == ["busy"]
    assert waiting_duties() == []


def test_a_device_has_one_guardian():
    with HeldDuty.take("riden", KEY):
        assert HeldDuty.take("riden", DeviceKey(frozenset({"/dev/elsewhere"}), 2, "77")) is None
        with HeldDuty.take("riden", TWIN) as other:
            assert other is not None
    with HeldDuty.take("riden", KEY) as later:
        assert later is not None


def test_only_the_same_device_relieves_the_guardian():
    with HeldDuty.take("riden", KEY) as held:
        held.wait("no answer")
        for other in (TWIN, DeviceKey(KEY.names, 1)):
            relieve(other)
            assert not held.relieved
        relieve(DeviceKey(frozenset({"/dev/elsewhere"}), 2, "77"))
        assert held.relieved


def test_device_of_another_type_with_the_same_serial_number_is_another_device():
    supply, board = replace(KEY, type_id="riden-rd60xx"), replace(KEY, type_id="sma-reference")
    with HeldDuty.take("riden", supply) as held, HeldDuty.take("board", board) as other:
        assert other is not None
        held.wait("no answer")
        assert [duty.key for duty in waiting_duties()] == [supply]
        relieve(board)
        assert not held.relieved
        relieve(supply)
        assert held.relieved


def test_a_guardian_whose_driver_lives_is_not_relieved():
    with HeldDuty.take("riden", KEY) as held:
        relieve(KEY)
        held.wait("no answer")
        assert not held.relieved


def test_a_relief_of_an_earlier_guardian_does_not_count():
    with HeldDuty.take("riden", KEY) as held:
        held.wait("no answer")
        relieve(KEY)
    with HeldDuty.take("riden", KEY) as held:
        assert not held.relieved
        held.wait("no answer")
        assert not held.relieved


def test_guardian_works_without_a_state_folder(state_home):
    (state_home / "smadrive").write_text("a file where the folder should be")
    with HeldDuty.take("riden", KEY) as held:
        held.wait("no answer")
        assert not held.relieved
    assert waiting_duties() == []


@pytest.mark.parametrize("use", [waiting_duties, lambda: relieve(KEY)])
def test_state_folder_that_cannot_be_listed_is_a_safety_error(monkeypatch, tmp_path, use):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / ("x" * 300)))
    with pytest.raises(SafetyError):
        use()


def test_pipe_among_the_duties_does_not_hang():
    with HeldDuty.take("riden", KEY) as held:
        held.wait("no answer")
        os.mkfifo(duties.state_dir() / "guardians" / "aa.json")
        assert [duty.key for duty in waiting_duties()] == [KEY]


def test_guardian_whose_state_folder_cannot_be_read_waits(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / ("x" * 300)))
    with HeldDuty.take("riden", KEY) as held:
        held.wait("no answer")
        assert not held.relieved
