"""TCLab on its serial line: an Arduino that heats with pulses and reads a thermometer, controlled by lines of text.

    command   reply                               meaning
    VER       TCLab Firmware 2.0.1 Arduino Uno    firmware and board
    Q1 12.60  12.600                              duty of heater 1 in %, 0 to 100
    R1        12.600                              duty of heater 1, read back
    T1        21.875                              temperature, °C
    P1 200    200.00                              pulse width at 100 % duty, at most 255
    LED 0.07  0.07                                brightness of the lamp for 10 s, used as a token: see text_line.py

Replies have no checksum. So the board must repeat the value of a command, and a measured value is read twice. After any
failure a late reply may still arrive, so the driver sends the greeting (text_line.py) before the next command.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import suppress
from functools import partial

from smadrive.devices.heating.text_line import Exchange, TextLine
from smadrive.devices.identity import UNKNOWN, TypeCheck
from smadrive.devices.profile.profile import Profile
from smadrive.devices.retry import retry_all
from smadrive.errors import (
    DeadlineError,
    IdentityError,
    ProtocolError,
    ReadBackError,
    SmadriveError,
    TransportError,
)
from smadrive.modbus.bus import Trace
from smadrive.modbus.transports.transport import Transport

GREETING = Exchange("VER", re.compile(r"TCLab Firmware (1\.4|2\.\d{1,2})\.\d{1,2} [A-Za-z][A-Za-z /]*"))
"""The greeting `VER`, and the firmware that is accepted. Older firmware rounds the duty to whole percents."""
NUMBER = re.compile(r"-?\d{1,3}\.\d{2,3}")
AGREE_C = 1.0
"""Largest difference in °C between two readings of the temperature. It is three steps of the converter."""
HEATERS = (1, 2)


class TCLabBoard:
    """A TCLab board, alone on its line. Every command is confirmed. `profile` contains line settings and timing."""

    def __init__(self, profile: Profile, transport: Transport, trace: Trace | None = None) -> None:
        """Nothing is sent yet."""
        self.profile = profile
        self.identity = UNKNOWN
        self.clock = transport.clock
        self._line = TextLine(transport, profile.timing.response_timeout_ms / 1e3, GREETING, _token, trace)
        self._name = transport.name
        self._identified = False

    @property
    def type_check(self) -> TypeCheck:
        """PROVED if the device has returned the banner of a TCLab, otherwise NOT_ASKED."""
        return TypeCheck.PROVED if self._identified else TypeCheck.NOT_ASKED

    def check_identity(self) -> None:
        """Prove by its banner that the device is a TCLab. Try again until `patience_s` has passed.

        Then DeadlineError for a silent device, IdentityError for another reply.
        """
        give_up_s = self.clock.now_s() + self.profile.timing.patience_s
        while not self._identified:
            try:
                self._line.greet()
                self._identified = True
            except (DeadlineError, ProtocolError) as error:
                if self.clock.now_s() >= give_up_s:
                    raise _unidentified(self._name, error) from None

    def read(self, command: str, *, proved: bool = False) -> float:
        """Send `command` and return the number in the reply.

        With `proved`, the board must first repeat a token, so that no older reply can be taken for this one.
        """
        if proved:
            self._line.distrust()
        return float(self._line.ask(command, NUMBER))

    def read_twice(self, command: str) -> float:
        """Send `command` twice and return the second number; ProtocolError when they differ by over `AGREE_C`."""
        first, second = self.read(command), self.read(command)
        if abs(first - second) > AGREE_C:
            self._line.distrust()
            raise ProtocolError(
                "two readings differ, so both are discarded",
                where=f"{self._name}: '{command}'",
                value=f"{first:g}, then {second:g}",
                limit=f"{AGREE_C:g} °C apart",
            )
        return second

    def read_back(self, command: str, expected: Sequence[float], *, proved: bool = False) -> float:
        """Send `command` and return the number in the reply.

        If this number is not one of the `expected` numbers, greet the board, send `command` once more, and return the
        second number.
        """
        number = self.read(command, proved=proved)
        if number in expected:
            return number
        self._line.distrust()
        return self.read(command)

    def heat(self, heater: int, duty: float) -> None:
        """Set the duty of heater 1 or 2, in %, and confirm it; ReadBackError when the board has another duty."""
        if not self._says_back(f"Q{heater}", duty):
            self._line.distrust()
            if (found := self.read(f"R{heater}")) != duty:
                raise ReadBackError(
                    "the duty reads back another value than the one that was set",
                    where=f"{self._name}: heater {heater}",
                    value=f"{found:g} %, set to {duty:g} %",
                )

    def limit_pulses(self, steps: int) -> None:
        """Limit heater 1: at a duty of 100 % its pulses then have the width `steps`, from 0 to 255 (always on).

        The board repeats the value. ReadBackError if it repeats another one.
        """
        if not self._says_back("P1", steps):
            self._line.distrust()
            raise ReadBackError(
                "the pulse width cannot be set",
                where=f"{self._name}: P1",
                value=steps,
                cure="check the firmware of the board",
            )

    def send_safe_state(self) -> None:
        """Switch both heaters off at once, without waiting for replies, if the last greeting got no right answer."""
        if self._line.is_unanswered:
            for heater in HEATERS:
                self._line.send_unconfirmed(f"Q{heater} 0.00")

    def enter_safe_state(self) -> None:
        """Switch both heaters off, confirmed by read-back; see `retry_all`. Each step first proves the identity."""
        with suppress(Exception):  # whatever the error is, the steps follow
            self.send_safe_state()
        retry_all([partial(self._switch_off, heater) for heater in HEATERS], self.clock)

    def _switch_off(self, heater: int) -> None:
        """Switch one heater off and confirm it.

        After a missing or wrong reply, the command is sent once more: the line may carry it although replies are lost.
        """
        try:
            self.heat(heater, 0.0)
            self._confirm_off(f"R{heater}")
        except (TransportError, ProtocolError):
            self._line.send_unconfirmed(f"Q{heater} 0.00")
            raise

    def _says_back(self, command: str, value: float) -> bool:
        """Send a value, but only to a device that is a TCLab; return True if the board repeats the value."""
        self.check_identity()
        return self.read(f"{command} {value:.2f}") == value

    def _confirm_off(self, command: str) -> None:
        if (duty := self.read(command, proved=True)) != 0.0:
            self._line.distrust()
            raise ReadBackError(
                "the heater is still on after its duty was set to 0",
                where=f"{self._name}: '{command}'",
                value=f"{duty:g} %",
            )


def _token(number: int) -> Exchange:
    """Return the exchange that sets the lamp to a brightness between 0.00 and 99.99 %.

    The board repeats the number, which distinguishes the reply from the replies to the previous tokens.
    """
    text = f"{number % 10_000 / 100:.2f}"
    return Exchange(f"LED {text}", re.compile(rf"{re.escape(text)}0?"))


def _unidentified(name: str, error: SmadriveError) -> SmadriveError:
    if isinstance(error, DeadlineError):
        return error
    return IdentityError(
        "no TCLab with firmware 1.4 or 2 answers",
        where=name,
        value=error.what,
        cure="check the profile and the port in the rig file",
    )
