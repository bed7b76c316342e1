"""TCLab as heat source. It heats with pulses, so a current is commanded as a duty: the share of the time with current.

The heat is proportional to the duty. So "current" and "voltage" mean root mean squares, with a duty from 0 to 1:

    i = full_scale_a · sqrt(duty)      u = full_scale_v · sqrt(duty)

The board measures neither. Both are computed from the duty that is read back and from the two full scales in the rig
file. The pulse width has `STEPS` steps, and a command is rounded down to a step.

Replies have no checksum. So every exchange reads back the duty in force, and reads the temperature twice: both readings
must agree. The board must repeat the new duty to the last digit. If a check fails, the whole exchange is discarded. But
zero duty is written before the temperature is read, and such an exchange ends with an invalid temperature: a sensor
with a loose contact must not keep the heater on. The board has no watchdog, although its documentation describes one.
"""

from __future__ import annotations

from math import floor, nan, sqrt

from smadrive.devices.heating.device_source import DeviceSource
from smadrive.devices.heating.heat_source import HeaterLimits, Sample, Supplied
from smadrive.devices.heating.tclab_board import TCLabBoard
from smadrive.errors import ConfigError, ProtocolError, ReadBackError, SafetyError

STEPS = 200
"""Number of steps of the pulse width, from off to 100 % duty: the factory setting of P1, which accepts up to 255."""
WITHIN = 0.2
"""A commanded duty lies this fraction of a step above its step, because the board may round down."""
COARSE = 0.01
"""If rounding down takes away more than this fraction of full_scale_a, the limit `pulse_width_step` is reported."""

SENSOR_RANGE_C = (-40.0, 150.0)
"""Range of the board's TMP36 sensor. An open or shorted sensor reads as an end of the converter, -50 or 280 °C."""


class TCLab(DeviceSource[TCLabBoard]):
    """A TCLabBoard as heat source; see HeatSource.

    `full_scale_a` and `full_scale_v` are the root mean square of current and voltage at the wire, at 100 % duty and at
    the pulse width `STEPS`.
    """

    measures = frozenset(("temperature",))
    has_watchdog = False
    has_temperature_limit = False

    def __init__(self, board: TCLabBoard, full_scale_a: float, full_scale_v: float) -> None:
        """Nothing is sent yet."""
        super().__init__(board)
        self._full_scale_a = full_scale_a
        self._full_scale_v = full_scale_v
        self._may_be: tuple[float, ...] = (0.0,)

    def configure(self, limits: HeaterLimits, watchdog_s: float) -> None:  # noqa: ARG002  (the board has no watchdog)
        """Set the pulse width at 100 % duty and confirm it; ConfigError when the board cannot keep the limits."""
        if limits.current_max_a > self._full_scale_a:
            raise ConfigError(
                "is more than the board can drive",
                where="current_max_a",
                value=f"{limits.current_max_a:g} A",
                limit=f"full_scale_a = {self._full_scale_a:g} A",
                cure="lower current_max_a",
            )
        if limits.voltage_max_v < self._full_scale_v:
            raise ConfigError(
                "is less than full_scale_v, but the board cannot limit its voltage",
                where="voltage_max_v",
                value=f"{limits.voltage_max_v:g} V",
                limit=f"full_scale_v = {self._full_scale_v:g} V",
                cure="lower the supply of the board, or leave voltage_max_v out",
            )
        self.device.limit_pulses(STEPS)

    def arm(self) -> None:
        """Arm the source if the board confirms zero duty; SafetyError when its heater is on. No output changes."""
        if duty := self.device.read("R1", proved=True):
            raise SafetyError(
                "not armed, because the board already heats",
                value=f"{duty:g} % duty",
                cure="check that no other program uses the board",
            )
        self._armed = True

    def exchange(self, current_a: float, *, proved: bool = False) -> Supplied:
        """Command `current_a` and measure; ReadBackError when the duty in force was not the commanded one."""
        in_force = self.device.read_back("R1", self._may_be, proved=proved)
        if in_force not in self._may_be:
            self._armed = False
            raise ReadBackError(
                "the board heats at another duty than the commanded one",
                value=f"{in_force:g} %, commanded {self._may_be[-1]:g} %",
                cure="check whether the board restarted, and that no other program uses it",
            )
        steps = floor(STEPS * (current_a / self._full_scale_a) ** 2 + 1e-9) if self._armed else 0
        duty = round(100.0 * (steps + WITHIN) / STEPS, 2) if steps else 0.0
        duty = min(duty, 100.0)
        if steps:
            temperature = self._temperature()
            self._command(duty)
        else:
            self._command(duty)
            temperature = self._temperature_if_known()
        return self._supplied(in_force, temperature, current_a - self._full_scale_a * sqrt(steps / STEPS))

    def enter_safe_state(self) -> None:
        """Set the duty of both heaters to zero, confirmed by read-back."""
        super().enter_safe_state()
        self._may_be = (0.0,)

    def clear_faults(self) -> None:
        """Do nothing, because the board latches no fault."""

    def _command(self, duty: float) -> None:
        """Set the duty, in %. If its confirmation is lost, the previous duty may still be in force, too."""
        self._may_be = (*self._may_be, duty)
        self.device.heat(1, duty)
        self._may_be = (duty,)

    def _temperature(self) -> Sample:
        """Read the temperature. It is invalid at the ends of its range; ProtocolError when two readings differ."""
        temperature_c = self.device.read_twice("T1")
        low_c, high_c = SENSOR_RANGE_C
        valid = low_c < temperature_c < high_c
        problem = None if valid else f"{temperature_c:.1f} °C is outside the range: the sensor is open or shorted"
        return Sample(temperature_c if valid else nan, self.device.clock.now_s(), problem)

    def _temperature_if_known(self) -> Sample:
        """Read the temperature. It is invalid, too, when two readings differ."""
        try:
            return self._temperature()
        except ProtocolError as error:
            return Sample(nan, self.device.clock.now_s(), str(error))

    def _supplied(self, in_force: float, temperature: Sample, lacking_a: float) -> Supplied:
        part = sqrt(floor(in_force / 100.0 * STEPS) / STEPS)
        return Supplied(
            self._full_scale_a * part,
            self._full_scale_v * part,
            self._armed,
            limits=("pulse_width_step",) if self._armed and lacking_a > COARSE * self._full_scale_a else (),
            temperature=temperature,
        )
