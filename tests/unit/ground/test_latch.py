"""What ended the last run is remembered until it is cleared."""

import os

import pytest

from smadrive.errors import SafetyError, TripError
from smadrive.latch import TripLatch

TRIP = TripError("fault 8: reads too cold; is the bead tight?", 8)
AT = "serial:///dev/serial/by-id/usb-1a86 unit 1"


def test_a_new_process_knows_it():
    TripLatch(AT).latch(TRIP)
    assert TripLatch(AT).told == str(TRIP)


def test_cleared_is_cleared_for_all():
    TripLatch(AT).latch(TRIP)
    TripLatch(AT).clear()
    assert TripLatch(AT).told is None
    TripLatch(AT).clear()


def test_other_heaters_have_their_own():
    TripLatch(AT).latch(TRIP)
    assert TripLatch("tcp://127.0.0.1:502").told is None


def test_a_simulated_one_forgets_it_with_the_process(state_home):
    latch = TripLatch(None)
    latch.latch(TRIP)
    assert latch.told == str(TRIP)
    assert TripLatch(None).told is None
    assert not list(state_home.iterdir())


def test_a_file_that_cannot_be_read_counts(state_home):
    TripLatch(AT).latch(TRIP)
    file = next((state_home / "smadrive").iterdir())
    file.write_bytes(b"\xff\xfe")
    assert "cannot be read" in TripLatch(AT).told


def test_a_file_that_is_empty_counts(state_home):
    TripLatch(AT).latch(TRIP)
    file = next((state_home / "smadrive").iterdir())
    file.write_text("\n")
    assert TripLatch(AT).told == f"a trip of unknown cause: {file} is empty"
    TripLatch(AT).clear()
    assert TripLatch(AT).told is None


@pytest.mark.parametrize("make", [os.mkdir, os.mkfifo])
def test_what_is_no_file_counts_until_somebody_removes_it(state_home, make):
    TripLatch(AT).latch(TRIP)
    file = next((state_home / "smadrive").iterdir())
    file.unlink()
    make(file)
    latch = TripLatch(AT)
    assert "a trip of unknown cause" in latch.told
    if file.is_dir():
        with pytest.raises(
            SafetyError, match=r"not cleared: .* cannot be removed \(Is a directory\): remove it by hand"
        ):
            latch.clear()
        assert "a trip of unknown cause" in latch.told
        file.rmdir()
    latch.clear()
    assert latch.told is None


@pytest.mark.parametrize("length", [200, 231, 300, 5000])
def test_an_address_of_any_length_is_remembered_for_itself_and_cleared(length):
    address, other = "tcp://" + "é" * length, "tcp://" + "é" * (length - 1) + "e"
    TripLatch(address).latch(TRIP)
    assert TripLatch(address).told == str(TRIP)
    assert TripLatch(other).told is None
    TripLatch(address).clear()
    assert TripLatch(address).told is None


def test_a_trip_that_cannot_be_written_down_says_so_and_holds_in_this_process(state_home):
    (state_home / "smadrive").write_text("a file where the folder should be")
    trip = TripError("fault 1", 1)
    latch = TripLatch(AT)
    latch.latch(trip)
    assert latch.told == "fault 1"
    assert "not remembered by the next start" in trip.__notes__[0]
