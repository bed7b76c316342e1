"""A survey finds every unit that answers, however late, and waits only once for all silent ones."""

import os
import pty
import threading
import time
import tty

import pytest

from smadrive.devices.line_survey import units_to_ask
from smadrive.modbus.framing import rtu
from smadrive.modbus.requests import read_holding
from smadrive.modbus.transports.connect import open_transport

UNITS = range(1, 11)
REQUESTS = [read_holding(address, 1) for address in (0, 8, 16)]
PATIENCE_S = 0.3


class Units:
    """Units on a pseudo-terminal: each replies after its delay to every request, or once only."""

    def __init__(self, delays_s, reply=None):
        self._main, self._other = pty.openpty()
        tty.setraw(self._other)
        self._delays_s, self._reply = delays_s, reply
        self._timers = []
        self.asked = []
        self.url = f"serial://{os.ttyname(self._other)}"
        self._thread = threading.Thread(target=self._serve)

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *_):
        os.write(self._other, bytes(8))  # ends the thread
        self._thread.join()
        for timer in self._timers:
            timer.join()
        for descriptor in (self._main, self._other):
            os.close(descriptor)

    def _serve(self):
        received = b""
        while True:
            received += os.read(self._main, 4096)
            while len(received) >= 8:
                frame, received = received[:8], received[8:]
                if frame == bytes(8):
                    return
                self._answer(frame[0])

    def _answer(self, unit_id):
        self.asked.append(unit_id)
        if unit_id in self._delays_s:
            reply = self._reply or rtu.seal(unit_id, bytes((3, 2, 0, 1)))
            self._timers.append(threading.Timer(self._delays_s[unit_id], os.write, (self._main, reply)))
            self._timers[-1].start()


def survey(units):
    with open_transport(units.url) as transport:
        return units_to_ask(transport, UNITS, REQUESTS, PATIENCE_S, lambda _: None)


@pytest.mark.parametrize("delay_s", [0.0, 0.1, 0.25])
def test_unit_that_answers_in_time_is_found(delay_s):
    with Units({7: delay_s}) as units:
        assert 7 in survey(units)


def test_only_the_units_that_answer_quickly_are_asked():
    """A busy machine may delay one reply into the next, and then all units are asked; not three times in a row."""
    with Units({3: 0.0, 9: 0.0}) as units:
        assert any(survey(units) == [3, 9] for _ in range(3))


def test_reply_that_is_not_whole_lets_all_units_be_asked():
    with Units({3: 0.0}, reply=b"\x03\x03\x02") as units:
        assert survey(units) == [*UNITS]


def test_silent_units_are_asked_every_request_and_waited_for_once():
    begun_s = time.monotonic()
    with Units({}) as units:
        assert survey(units) == []
    assert sorted(units.asked) == sorted([*UNITS] * len(REQUESTS))
    assert time.monotonic() - begun_s < len(UNITS) * PATIENCE_S
