"""TCLab as heat source: a current is commanded as the duty of its pulses.

Heat goes with the duty, so a current means its root mean square:

    i = full_scale_a · sqrt(duty)      u = full_scale_v · sqrt(duty)

The board measures neither. Current and voltage are computed from the duty that it reads back and from the two full
scales of the rig file. The pulse width has `STEPS` steps; a command is rounded down to a step.

Replies have no checksum. So every exchange reads the duty in force back, takes a temperature only if the board gives
it twice, and ends with the new duty said back to the last digit. If one of these fails, all are discarded. The board
has no watchdog, although its documentation describes one.
"""

from __future__ import annotations

from math import floor, nan, sqrt

from smadrive.devices.heating.heat_source import HeaterLimits, Sample, Supplied
from smadrive.devices.heating.tclab_board import TCLabBoard
from smadrive.devices.identity import Identity
from smadrive.errors import ConfigError, ReadBackError, SafetyError

STEPS = 200
"""Steps of the pulse width from off to full: the board's factory limit P1, of 255."""
WITHIN = 0.2
"""Where in a step a duty is commanded, so that the board's rounding does not miss it."""
COARSE = 0.01
"""A step that takes away more than this part of full scale is reported as a limit."""

SENSOR_RANGE_C = (-40.0, 150.0)
"""Range of its TMP36; the converter's ends, -50 and 280 °C, are those of a sensor that is open or shorted."""


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
        """Set the pulse width at 100 % duty, confirmed; ConfigError when the board cannot keep the limits."""
        if limits.current_max_a > self._full_scale_a:
            raise ConfigError(
                "is more than the board can drive",
                where="current_max_a",
                value=f"{limits.current_max_a:g} A",
                limit=f"full_scale_a = {self._full_scale_a:g} A",
                cure="lower it",
            )
        if limits.voltage_max_v < self._full_scale_v:
            raise ConfigError(
                "is less than full_scale_v, and the board cannot limit its voltage",
                where="voltage_max_v",
                value=f"{limits.voltage_max_v:g} V",
                limit=f"full_scale_v = {self._full_scale_v:g} V",
                cure="lower the supply of the board, or leave voltage_max_v out",
            )
        self._board.limit_pulses(STEPS)

    def arm(self) -> None:
        """Arm after zero duty is confirmed; SafetyError when the heater is on. Nothing is switched."""
        if duty := self._board.read("R1", proved=True):
            raise SafetyError(
                "not armed, the board heats already",
                value=f"{duty:g} % duty",
                cure="check that no other program talks to it",
            )
        self._armed = True

    def exchange(self, current_a: float, *, proved: bool = False) -> Supplied:
        """Command `current_a` and measure; ReadBackError when the duty so far was not the commanded one."""
        in_force = self._board.read_back("R1", self._may_be, proved=proved)
        if in_force not in self._may_be:
            self._armed = False
            raise ReadBackError(
                "the board heats at another duty than commanded",
                value=f"{in_force:g} %, commanded {self._may_be[-1]:g} %",
                cure="check whether it restarted, and that no other program talks to it",
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
        """Return at once: the board latches no fault."""

    def _supplied(self, in_force: float, temperature_c: float, lacking_a: float) -> Supplied:
        part = sqrt(floor(in_force / 100.0 * STEPS) / STEPS)
        low_c, high_c = SENSOR_RANGE_C
        valid = low_c < temperature_c < high_c
        problem = None if valid else f"{temperature_c:.1f} °C, outside the range of the sensor: open or shorted"
        return Supplied(
            self._full_scale_a * part,
            self._full_scale_v * part,
            self._armed,
            limits=("pulse_width_step",) if self._armed and lacking_a > COARSE * self._full_scale_a else (),
            temperature=Sample(temperature_c if valid else nan, self._board.clock.now_s(), problem),
        )
