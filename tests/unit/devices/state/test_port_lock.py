"""`scan` and `board` do not use a port while a driver uses a unit there."""

from contextlib import ExitStack

import pytest

from smadrive.devices.profile.profile import load_profile
from smadrive.devices.scan import scan
from smadrive.devices.state.key import key_at
from smadrive.devices.state.lock import Role, lines_of, lock_line
from smadrive.devices.state.port_lock import lock_port
from smadrive.errors import BusyError, TransportError
from smadrive.rig.ports.board_port import open_board

PROFILES = [load_profile(name) for name in ("sma-reference", "riden-rd60xx")]
URL = "rtu+tcp://127.0.0.1:1"
"""An address at which nothing listens."""
GATEWAY = URL.removeprefix("rtu+")


def heated(unit_id, url=URL):
    """Hold the lines that a driver of this unit locks."""
    with ExitStack() as stack:
        for line in lines_of(key_at(url, PROFILES[0], unit_id)):
            stack.enter_context(lock_line(line, Role.DRIVER))
        return stack.pop_all()


def use_board(url=URL):
    with open_board(url):
        pass


def use_scan(url=URL):
    for _ in scan(url, [2, 3], PROFILES, lambda _line, _unit_id: None):
        pass


@pytest.mark.parametrize("unit_id", [1, 3, 7])
@pytest.mark.parametrize(("url", "line"), [(URL, "tcp://127.0.0.1:1"), (GATEWAY, "unit {}")])
@pytest.mark.parametrize("used", [URL, GATEWAY])
@pytest.mark.parametrize("use", [use_board, use_scan])
def test_network_port_with_a_driver_is_busy(use, used, unit_id, url, line):
    """Also if the driver takes the port for a gateway, and the other program for a serial line, or the reverse."""
    with heated(unit_id, url), pytest.raises(BusyError) as error:
        use(used)
    assert error.value.where.endswith(line.format(unit_id))
    with pytest.raises(TransportError) as error:
        use(used)
    assert not isinstance(error.value, BusyError)


@pytest.mark.parametrize("use", [use_board, use_scan])
def test_driver_of_another_port_is_not_in_the_way(use):
    with heated(1, "rtu+tcp://127.0.0.1:2"), pytest.raises(TransportError) as error:
        use()
    assert not isinstance(error.value, BusyError)


@pytest.mark.parametrize("url", [URL, "serial:///dev/ttyUSB0"])
def test_driver_and_second_scan_are_refused_during_a_scan(url):
    with lock_port(url, [1, 2]):
        for start in (lambda: heated(1, url), lambda: lock_port(url, [2])):
            with pytest.raises(BusyError):
                start()
    heated(1, url).close()
