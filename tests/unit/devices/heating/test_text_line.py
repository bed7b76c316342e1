"""On a text line without checksums, no late, foreign or incomplete line is accepted as the answer to a command."""

import random
import re

import pytest

from smadrive.clock import VirtualClock
from smadrive.devices.heating.text_line import Exchange, TextLine
from smadrive.errors import DeadlineError, IdentityError, ProtocolError, TransportError
from smadrive.modbus.transports.in_process import InProcessTransport

NUMBER = re.compile(r"-?\d{1,3}\.\d{2,3}")
GREETING = Exchange("VER", re.compile(r"Board \d"))
TIMEOUT_S = 0.15


class Board:
    """A board that answers a greeting with `Board 1`, a token with the token, and other commands with their number.

    `delays_s` are the delays of its replies. `says` replaces the reply to a command.
    """

    def __init__(self, delays_s=(), says=()):
        self.delays_s = list(delays_s)
        self.says = dict(says)
        self.heard = []
        self.busy_until_s = 0.0

    def receive(self, data, time_s):
        command = data.decode().strip()
        self.heard.append(command)
        self.busy_until_s = max(time_s, self.busy_until_s) + (self.delays_s.pop(0) if self.delays_s else 0.001)
        return [(self.busy_until_s, self.says.get(command, f"{self.right(command)}\r\n".encode()))]

    @staticmethod
    def right(command):
        if command == "VER":
            return "Board 1"
        return command if command.startswith("token") else f"{int(command.split()[1])}.000"


def line_to(board):
    transport = InProcessTransport(board, VirtualClock())
    return TextLine(transport, TIMEOUT_S, GREETING, token), transport


def token(number):
    return Exchange(f"token{number}", re.compile(f"token{number}"))


def test_nothing_is_sent_before_the_banner():
    board = Board()
    line, _ = line_to(board)
    assert line.ask("N 7", NUMBER) == "7.000"
    assert line.ask("N 8", NUMBER) == "8.000"
    assert board.heard == ["VER", "token0", "N 7", "N 8"]


WRONG = [
    *(b"7\r\n", b"7.0\r\n", b"7.0000\r\n", b" 7.000\r\n", b"7.000 \r\n", b"+7.000\r\n", b"-.00\r\n", b"1000.00\r\n"),
    *(b"7,000\r\n", b"1e1\r\n", b"nan\r\n", b"\r\n", b"Board 1\r\n", b"7.000\r\r\n", b"7.000\n\r\n", b"7.000\x00\r\n"),
    *(b"\xb7.000\r\n", b"\xd9\xa7.000\r\n", b"7.000\r\n8.000\r\n", b"7.000\r\n8", b"x" * 70),
]


@pytest.mark.parametrize("wrong", WRONG, ids=repr)
def test_wrong_line_is_rejected_and_the_board_greeted_again(wrong):
    board = Board(says={"N 7": wrong})
    line, _ = line_to(board)
    with pytest.raises(ProtocolError) as error:
        line.ask("N 7", NUMBER)
    assert error.value.where.endswith("'N 7'")
    assert error.value.limit in {None, "64 characters"}
    assert line.ask("N 8", NUMBER) == "8.000"
    assert board.heard == ["VER", "token0", "N 7", "VER", "token1", "N 8"]


@pytest.mark.parametrize("torn", [b"7.000", b"7.000\r", b"7."])
def test_a_line_without_its_end_is_a_missed_deadline(torn):
    board = Board(says={"N 7": torn})
    line, _ = line_to(board)
    with pytest.raises(DeadlineError) as error:
        line.ask("N 7", NUMBER)
    assert error.value.value == f"{len(torn)} characters"
    assert line.clock.now_s() <= 2 * TIMEOUT_S
    assert line.ask("N 8", NUMBER) == "8.000"


def test_a_late_reply_is_dropped_although_it_has_the_right_form():
    board = Board([0.0, 0.0, 0.2])
    line, _ = line_to(board)
    with pytest.raises(DeadlineError) as error:
        line.ask("N 7", NUMBER)
    assert error.value.value == "0 characters"
    assert "powered" in error.value.cure
    assert line.ask("N 8", NUMBER) == "8.000"
    assert board.heard == ["VER", "token0", "N 7", "VER", "token1", "N 8"]


def test_unrequested_line_is_dropped_and_the_board_greeted():
    board = Board()
    line, transport = line_to(board)
    line.ask("N 7", NUMBER)
    transport.deliver(line.clock.now_s(), b"99.000\r\n")
    assert line.ask("N 8", NUMBER) == "8.000"
    assert board.heard[-3:] == ["VER", "token1", "N 8"]


def test_another_board_is_refused():
    board = Board()
    line, transport = line_to(board)
    line.ask("N 7", NUMBER)
    board.says["VER"] = b"Board 2\r\n"
    transport.disconnect()
    with pytest.raises(IdentityError) as error:
        line.ask("N 8", NUMBER)
    assert error.value.value == "'Board 2', was 'Board 1'"
    assert board.heard[-1] == "VER"


def ask_in_vain(board, line):
    """Ask the board, which does not answer the greeting any more."""
    board.says["VER"] = b""
    with pytest.raises(DeadlineError):
        line.ask("N 8", NUMBER)


def test_unconfirmed_command_needs_a_greeted_board():
    board = Board()
    line, _ = line_to(board)
    line.send_unconfirmed("N 0")
    assert board.heard == []
    line.ask("N 7", NUMBER)
    line.send_unconfirmed("N 0")
    assert board.heard[-1] == "N 0"
    ask_in_vain(board, line)
    line.send_unconfirmed("N 1")
    assert board.heard[-1] == "N 1"


def test_unconfirmed_command_is_not_sent_to_a_silent_device_on_a_new_connection():
    board = Board()
    line, transport = line_to(board)
    line.ask("N 7", NUMBER)
    transport.disconnect()
    ask_in_vain(board, line)
    line.send_unconfirmed("N 0")
    assert board.heard[-1] == "VER"


def test_line_that_is_never_silent_is_an_error():
    line, transport = line_to(Board(says={"VER": b"?\r\n"}))
    for tenth in range(100):
        transport.deliver(0.1 * tenth, b"chatter\r\n")
    with pytest.raises(TransportError) as error:
        line.ask("N 7", NUMBER)
    assert error.value.where == transport.name


class ChatteringPort(InProcessTransport):
    """A port on which foreign lines arrive without end. Like a serial port, it returns them after the deadline, too."""

    def read(self, deadline_s):
        self.clock.sleep_until(self.clock.now_s() + 0.01)
        assert self.clock.now_s() < 60.0
        return b"chatter\r\n"


def test_foreign_lines_without_end_are_an_error():
    port = ChatteringPort(Board(), VirtualClock())
    with pytest.raises(TransportError) as error:
        TextLine(port, TIMEOUT_S, GREETING, token).ask("N 7", NUMBER)
    assert error.value.where.startswith(port.name)


@pytest.mark.parametrize("seed", range(4))
def test_late_lines_are_rejected(seed):
    """A fifth of the replies is delayed by up to four timeouts.

    Each command gets its own reply, or a typed error in time.
    """
    chance = random.Random(seed)
    board = Board()
    line, _ = line_to(board)
    right = failed = 0
    for number in range(2000):
        board.delays_s = [chance.uniform(0.0, 0.6) if chance.random() < 0.2 else 0.001 for _ in range(9)]
        command = f"N {number % 1000}"
        begun_s = line.clock.now_s()
        try:
            assert line.ask(command, NUMBER) == f"{number % 1000}.000"
            right += 1
        except (DeadlineError, ProtocolError):
            failed += 1
        assert line.clock.now_s() - begun_s < 5.0
        line.clock.sleep_until(line.clock.now_s() + chance.choice((0.0, 0.05, 0.3)))
    assert right > 1000
    assert failed > 100
