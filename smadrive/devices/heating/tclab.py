"""TCLab: an Arduino that heats by pulses and reads a thermometer, commanded by lines of text.

    command   reply                               what
    VER       TCLab Firmware 2.0.1 Arduino Uno    who it is
    Q1 12.60  12.600                              duty of heater 1 in %, 0 to 100
    R1        12.600                              that duty, read back
    T1        21.875                              temperature, °C
    P1 200    200.00                              pulse width, of 255, that 100 % stands for
    LED 0.07  0.07                                brightness of its lamp for 10 s: a token, see textline.py

Heat goes with the duty, so a current means its root mean square:

    i = full_scale_a · sqrt(duty)      u = full_scale_v · sqrt(duty)

The board measures neither: what it is believed to drive follows from the duty that it reads back and from the two full
scales, which the rig file tells. The pulse width has `STEPS` steps, of which the next smaller one is taken.

Replies have no checksum. So every exchange reads the duty in force back, takes a temperature only if the board says it
twice, and ends with the new duty said back to the last digit; if any of it fails, all of it is discarded. The board has
no watchdog, whatever its documentation says.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import partial
from math import floor, nan, sqrt

from smadrive.devices.heating.heat_source import HeaterLimits, Sample, Supplied
from smadrive.devices.heating.text_line import Exchange, TextLine
from smadrive.devices.identity import UNKNOWN, Identity, Proof
from smadrive.devices.profile.profile import Profile
from smadrive.devices.retry import retry_all
from smadrive.errors import (
    ConfigError,
    DeadlineError,
    IdentityError,
    ProtocolError,
    ReadBackError,
    SafetyError,
    SmadriveError,
    TransportError,
)
from smadrive.modbus.bus import Trace
from smadrive.modbus.transports.transport import Transport

GREETING = Exchange("VER", re.compile(r"TCLab Firmware (1\.4|2\.\d{1,2})\.\d{1,2} [A-Za-z][A-Za-z /]*"))
"""Older firmware rounds the duty to whole percents."""
NUMBER = re.compile(r"-?\d{1,3}\.\d{2,3}")

STEPS = 200
"""Of the pulse width from off to full: the board's factory limit P1, of 255."""
WITHIN = 0.2
"""Where in a step a duty is commanded, so that the board's rounding does not miss it."""
COARSE = 0.01
"""A step that takes away more than this part of full scale is told as a limit."""

SENSOR_RANGE_C = (-40.0, 150.0)
"""Of its TMP36; the converter's ends, -50 and 280 °C, are those of a sensor that is open or shorted."""
AGREE_C = 1.0
"""By how much two readings of the temperature may differ: three steps of the converter."""


class TCLabBoard:
    """The board on a line of its own: commands, each confirmed. `profile` tells its line settings and timing."""

    def __init__(self, profile: Profile, transport: Transport, trace: Trace | None = None) -> None:
        """Nothing is sent yet."""
        self.profile = profile
        self.identity = UNKNOWN
        self.clock = transport.clock
        self._line = TextLine(transport, profile.timing.response_timeout_ms / 1e3, GREETING, _token, trace)
        self._name = transport.name
        self._identified = False

    @property
    def proof(self) -> Proof:
        """See AnyDevice."""
        return Proof.PROVED if self._identified else Proof.NOT_ASKED

    def check_identity(self) -> None:
        """Prove that it is a TCLab, whose start is waited for; IdentityError when something else answers."""
        give_up_s = self.clock.now_s() + self.profile.timing.boot_ms / 1e3
        while not self._identified:
            try:
                self._line.greet()
                self._identified = True
            except (DeadlineError, ProtocolError) as error:
                if self.clock.now_s() >= give_up_s:
                    raise _unidentified(self._name, error) from None

    def read(self, command: str, *, proved: bool = False) -> float:
        """The number that answers `command`; `proved`: the board says back a token first, behind every older reply."""
        if proved:
            self._line.distrust()
        return float(self._line.ask(command, NUMBER))

    def read_twice(self, command: str) -> float:
        """The number that answers `command` twice, give or take `AGREE_C`; ProtocolError when the answers differ."""
        first, second = self.read(command), self.read(command)
        if abs(first - second) > AGREE_C:
            self._line.distrust()
            raise ProtocolError(f"{self._name}: '{command}' is {first:g}, then {second:g}: a damaged reply, discarded")
        return second

    def read_back(self, command: str, expected: Sequence[float], *, proved: bool = False) -> float:
        """The number that answers `command`; asked for once more if it is none of the `expected` ones."""
        number = self.read(command, proved=proved)
        if number in expected:
            return number
        self._line.distrust()
        return self.read(command)

    def heat(self, heater: int, duty: float) -> None:
        """Set the duty of heater 1 or 2, confirmed; ReadBackError when the board has another one."""
        if not self._says_back(f"Q{heater}", duty):
            self._line.distrust()
            if (found := self.read(f"R{heater}")) != duty:
                raise ReadBackError(f"{self._name}: heater {heater} was set to {duty:g} %, reads back {found:g} %")

    def limit_pulses(self, steps: int) -> None:
        """Set the pulse width that 100 % of heater 1 stands for, confirmed; ReadBackError when it did not arrive."""
        if not self._says_back("P1", steps):
            self._line.distrust()
            raise ReadBackError(f"{self._name}: the pulse width P1 cannot be set to {steps}: is it another firmware?")

    def enter_safe_state(self) -> None:
        """Both heaters off, confirmed by reading them back; see `retry_all`."""
        self.check_identity()
        retry_all([partial(self._switch_off, heater) for heater in (1, 2)], self.clock)

    def _switch_off(self, heater: int) -> None:
        """Without an answer the command is sent once more: the line may carry it although no reply comes back."""
        try:
            self.heat(heater, 0.0)
            self._confirm_off(f"R{heater}")
        except (TransportError, ProtocolError):
            if self._identified:
                self._line.send_unconfirmed(f"Q{heater} 0.00")
            raise

    def _says_back(self, command: str, value: float) -> bool:
        """Whether the board answers with the value that it is told; nothing is told to anything but a TCLab."""
        self.check_identity()
        return self.read(f"{command} {value:.2f}") == value

    def _confirm_off(self, command: str) -> None:
        if (duty := self.read(command, proved=True)) != 0.0:
            self._line.distrust()
            raise ReadBackError(f"{self._name}: '{command}' still reads {duty:g} % after it was set to 0")


class TCLab:
    """A TCLabBoard as heat source; see HeatSource.

    `full_scale_a`, `full_scale_v`: root mean square of current and voltage at the wire at 100 % duty (P1 at `STEPS`).
    """

    measures = frozenset(("temperature",))
    has_watchdog = False

    def __init__(self, board: TCLabBoard, full_scale_a: float, full_scale_v: float) -> None:
        """Nothing is sent yet."""
        self.settle_s = board.profile.timing.settle_ms / 1e3
        self._board = board
        self._full_scale_a = full_scale_a
        self._full_scale_v = full_scale_v
        self._armed = False
        self._may_be: tuple[float, ...] = (0.0,)

    @property
    def identity(self) -> Identity:
        """See HeatSource."""
        return self._board.identity

    @property
    def armed(self) -> bool:
        """Whether it was armed at every exchange since `arm`."""
        return self._armed

    def connect(self) -> None:
        """Prove the board's identity and switch its heaters off."""
        self._board.check_identity()
        self.enter_safe_state()

    def configure(self, limits: HeaterLimits, watchdog_s: float) -> None:  # noqa: ARG002  (the board has no watchdog)
        """Check that the limits mean something for this board, and fix what 100 % stands for, confirmed."""
        if limits.current_max_a > self._full_scale_a:
            raise ConfigError(
                f"current_max_a = {limits.current_max_a:g} is more than the board gives: full_scale_a = "
                f"{self._full_scale_a:g}: lower it"
            )
        if limits.voltage_max_v < self._full_scale_v:
            raise ConfigError(
                f"voltage_max_v = {limits.voltage_max_v:g} is less than full_scale_v = {self._full_scale_v:g}, which "
                "the board cannot limit: lower its supply, or leave voltage_max_v out"
            )
        self._board.limit_pulses(STEPS)

    def arm(self) -> None:
        """Nothing to switch: armed, at zero duty, confirmed; SafetyError when a heater is on."""
        if duty := self._board.read("R1", proved=True):
            raise SafetyError(f"not armed: the board heats already, at {duty:g} %: does another program talk to it?")
        self._armed = True

    def exchange(self, current_a: float, *, proved: bool = False) -> Supplied:
        """Command `current_a` and measure; ReadBackError when the duty so far was not the commanded one."""
        in_force = self._board.read_back("R1", self._may_be, proved=proved)
        if in_force not in self._may_be:
            self._armed = False
            raise ReadBackError(
                f"the board heats at {in_force:g} %, {self._may_be[-1]:g} % were commanded: did it restart, or does "
                "another program talk to it?"
            )
        temperature_c = self._board.read_twice("T1")
        steps = floor(STEPS * (current_a / self._full_scale_a) ** 2 + 1e-9) if self._armed else 0
        duty = round(100.0 * (steps + WITHIN) / STEPS, 2) if steps else 0.0
        duty = min(duty, 100.0)
        self._may_be = (*self._may_be, duty)
        self._board.heat(1, duty)
        self._may_be = (duty,)
        return self._supplied(in_force, temperature_c, current_a - self._full_scale_a * sqrt(steps / STEPS))

    def enter_safe_state(self) -> None:
        """See HeatSource."""
        self._armed = False
        self._board.enter_safe_state()
        self._may_be = (0.0,)

    def clear_faults(self) -> None:
        """It latches none."""

    def _supplied(self, in_force: float, temperature_c: float, lacking_a: float) -> Supplied:
        part = sqrt(floor(in_force / 100.0 * STEPS) / STEPS)
        low_c, high_c = SENSOR_RANGE_C
        valid = low_c < temperature_c < high_c
        problem = None if valid else f"{temperature_c:.1f} °C, out of the sensor's range: open or shorted"
        return Supplied(
            self._full_scale_a * part,
            self._full_scale_v * part,
            self._armed,
            limits=("pulse_width_step",) if self._armed and lacking_a > COARSE * self._full_scale_a else (),
            temperature=Sample(temperature_c if valid else nan, self._board.clock.now_s(), problem),
        )


def _token(number: int) -> Exchange:
    """One of ten thousand brightnesses."""
    text = f"{number % 10_000 / 100:.2f}"
    return Exchange(f"LED {text}", re.compile(rf"{re.escape(text)}0?"))


def _unidentified(name: str, error: SmadriveError) -> SmadriveError:
    if isinstance(error, DeadlineError):
        return error
    return IdentityError(f"{name}: no TCLab of firmware 1.4 or 2 answers ({error}): check profile and port of the rig")
