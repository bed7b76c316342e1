"""Feasibility of a reference: the result of a simulated run, with its warnings and errors for the user."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from smadrive.control.controllers.tracking import DISPLACEMENT_NOISE
from smadrive.control.references.reference import Reference
from smadrive.errors import ConfigError
from smadrive.wire.recorded_loops import Sections

Limit = Literal["cooling", "heater", "hysteresis"]

TOLERANCE = 0.02
"""Largest error of a feasible reference, in strokes; the controller corrects an error of this size."""

SMOOTHED_TOLERANCE = 0.05
"""Largest error of smoothed cycles that are simulated again, in strokes. Sharp corners leave up to this error.

It holds for the cycles of a continuation, too: the previous part may have smoothed them.
"""

JUMP = 20.0
"""A reference that is more than this many times too fast counts as a jump; slowing it down does not help."""

SLOW_S, SLOWEST_PER_S = 7200.0, 1.0 / 14_400.0
"""A reference that is longer, s, and has a lower mean speed, in strokes per s, probably has its times in ms."""

VISIBLE = 6.0
"""A movement of less than this many standard deviations of the displacement sensor is lost in the sensor's noise."""

REASONS: dict[Limit, str] = {
    "cooling": "even without current the wire cools no faster",
    "heater": "even with the largest current the wire heats no faster",
    "hysteresis": "the reference reverses too soon: while the wire crosses its hysteresis, it does not move",
}


@dataclass(frozen=True)
class Feasibility:
    """The result of a simulated run of a reference.

    feasible                   True if the largest error is at most the tolerance of the simulation
    nearest                    reference that the wire can follow: the given reference if it is feasible
    shortfall_mm, at_s         largest error; its time
    limit, in_approach         cause of the largest error; True if its time is in the approach
    setpoint_mm_per_s          mean rate of the setpoint while the wire fell behind
    reached_mm_per_s           mean rate of the wire while it fell behind
    hottest_c, sections_c      highest temperature of the run; sections of its temperature path
    stroke_mm, span_mm         stroke of the wire; span of the reference after its approach
    scored_from_s              duration of the approach
    scored_s, speed_mm_per_s   duration and mean speed of the reference after its approach, of one cycle
    hot_start_mm               first displacement after the approach if it is at the hot end of the span, otherwise None
    """

    feasible: bool
    nearest: Reference
    shortfall_mm: float
    stroke_mm: float
    at_s: float
    limit: Limit
    setpoint_mm_per_s: float
    reached_mm_per_s: float
    hottest_c: float
    in_approach: bool
    scored_from_s: float
    scored_s: float
    span_mm: float
    speed_mm_per_s: float
    hot_start_mm: float | None
    sections_c: Sections

    @property
    def caveats(self) -> tuple[str, ...]:
        """The warnings about this run for the user, one sentence each."""
        caveats = []
        if 0.0 < self.span_mm < VISIBLE * DISPLACEMENT_NOISE * self.stroke_mm:
            small = f"the reference moves by {self.span_mm:.2g} mm only, of a stroke of {self.stroke_mm:.3g} mm"
            caveats.append(f"{small}: this movement is lost in the noise of a displacement sensor; is it in mm?")
        if self.scored_s > SLOW_S and 0.0 < self.speed_mm_per_s < SLOWEST_PER_S * self.stroke_mm:
            slow = f"the reference lasts {self.scored_s / 3600.0:.1f} h and moves by {3600.0 * self.speed_mm_per_s:.2g}"
            caveats.append(f"{slow} mm per hour on average; are its times in seconds?")
        if self.hot_start_mm is not None:
            start = f"the reference begins at its hot end, {self.hot_start_mm:.3g} mm"
            caveats.append(f"{start}, so the wire is heated there first; check low_mm and high_mm")
        if not self.feasible:
            caveats.append(f"the reference was smoothed, and all errors refer to the smoothed reference: {self}")
        return tuple(caveats)

    @property
    def slower(self) -> float:
        """The factor by which the reference must be slowed down, approximately; at least 1.1."""
        return max(1.1, abs(self.setpoint_mm_per_s) / max(abs(self.reached_mm_per_s), 1e-3 * self.stroke_mm))

    @property
    def _at_s_of_cycle(self) -> float:
        return (self.at_s - self.scored_from_s) % self.scored_s

    def __str__(self) -> str:
        """Return one sentence for the user."""
        percent = 100.0 * self.shortfall_mm / self.stroke_mm
        if self.feasible:
            error = f"an error of at most {percent:.1f} % of the stroke"
            return f"feasible with {error} and a highest temperature of {self.hottest_c:.0f} °C"
        error = f"at {self.at_s:.1f} s the error is {self.shortfall_mm:.2g} mm ({percent:.0f} % of the stroke)"
        return f"{error}: {self._motion}; {REASONS[self.limit]}"

    @property
    def _motion(self) -> str:
        setpoint_mm_per_s, reached_mm_per_s = self.setpoint_mm_per_s, self.reached_mm_per_s
        if reached_mm_per_s * setpoint_mm_per_s > setpoint_mm_per_s**2:
            return f"the wire is late, and catches up at {reached_mm_per_s:+.2g} mm/s"
        return f"the reference moves at {setpoint_mm_per_s:+.2g} mm/s, the wire at {reached_mm_per_s:+.2g} mm/s"

    def check(self, temperature_max_c: float, *, smooth: bool, smooth_option: str, way_back_s: float = 0.0) -> None:
        """Raise ConfigError when the reference is not feasible, or needs a temperature above the limit.

        With `smooth` the nearest feasible reference is tracked instead, and only its temperature is checked. The cure
        of the error contains `smooth_option`: the option of the command line, or the argument in Python, that requests
        the nearest feasible reference. Each cycle ends with a way back of `way_back_s`, which the user did not give.
        """
        if not (self.feasible or smooth):
            cure = f"{self._first_cure(way_back_s)}run the nearest reference that the wire can follow ({smooth_option})"
            raise ConfigError(str(self), where="reference", cure=cure)
        if self.hottest_c > temperature_max_c:
            raise ConfigError(
                "needs a wire temperature above temperature_max_c",
                where="reference",
                value=f"{self.hottest_c:.0f} °C",
                limit=f"{temperature_max_c:g} °C",
                cure="lower the highest displacement, or raise temperature_max_c if the data sheet allows it",
            )

    def check_smoothed(self) -> None:
        """Raise ConfigError when the wire cannot follow the cycles of this run, whose reference was smoothed."""
        if self.shortfall_mm > SMOOTHED_TOLERANCE * self.stroke_mm:
            what = f"too fast to be repeated, also when it is smoothed: {self}"
            raise ConfigError(what, where="reference", cure="give a slower reference that ends where it begins")

    def _first_cure(self, way_back_s: float) -> str:
        """Return the beginning of the cure for a reference that is not feasible; "" for a jump."""
        if self.at_s == 0.0:
            return "check that the model belongs to this wire, and that its displacements are in mm, or "
        if way_back_s and not self.in_approach and self._at_s_of_cycle >= self.scored_s - way_back_s:
            return f"let the reference end where it begins, without the way back of {way_back_s:g} s, or "
        if self.in_approach and self.limit == "cooling":
            return "let the wire cool first, because it is still hot (in Python: rig.cool_down(60)), or "
        if self.in_approach and self.limit == "heater":
            return "check current_max_a and the zero of a displacement sensor, begin the reference lower, or "
        if self.in_approach:
            return "check the zero of a displacement sensor, begin at another displacement, or "
        return "" if self.slower > JUMP else f"slow the reference down about {self.slower:.1f} times, or "
