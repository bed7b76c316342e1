"""Feasibility of a reference: a simulated run on the identified wire, before the run on the real wire.

The controller of the real run tracks the reference on the model of the wire, in simulated time, without noise. The
surroundings limit the cooling, and the heater limits the heating. The displacement that the model reaches is the
nearest feasible reference. The simulated wire cools more slowly by the share `MARGIN`, and its largest current is lower
by the same share, so that the controller of the real wire keeps a reserve.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np

from smadrive.control.controllers.tracking import DISPLACEMENT_NOISE, TrackingController
from smadrive.control.controllers.tracking_feedback import TrackingSettings
from smadrive.control.feedforward.displacement import DisplacementInverse
from smadrive.control.references.reference import Reference
from smadrive.errors import ConfigError
from smadrive.measurement import DisplacementFrom, Measurement
from smadrive.numerics.arrays import FloatArray
from smadrive.wire.recorded_loops import Sections, sections_of
from smadrive.wire.wire_model import WireModel, WireState

Limit = Literal["cooling", "heater", "hysteresis"]

MARGIN = 0.1
"""Share by which the simulated heat loss and the simulated largest current are reduced."""

TOLERANCE = 0.02
"""Largest error of a feasible reference, in strokes; the controller corrects an error of this size."""

CYCLES = 3
"""Largest number of simulated cycles of a repeated reference; all later cycles are like the last simulated cycle."""

SUBSTEPS = 3
"""Number of simulation steps of the wire per period of the loop."""

JUMP = 20.0
"""A reference that is more than this many times too fast counts as a jump; slowing it down does not help."""

AT_END = 0.05
"""A path begins at an end of its span if its first value is nearer to this end than this share of the span."""

SLOW_S, SLOWEST_PER_S = 7200.0, 1.0 / 14_400.0
"""A reference that is longer, s, and has a lower mean speed, in strokes per s, probably has its times in ms."""

STEADY_C = 1.0
"""A reversal of the temperature by less than twice this value, K, does not begin a new section."""

VISIBLE = 6.0
"""A movement of less than this many standard deviations of the displacement sensor is lost in the sensor's noise."""

REASONS: dict[Limit, str] = {
    "cooling": "even without current the wire cools no faster",
    "heater": "even with the largest current the wire heats no faster",
    "hysteresis": "the reference reverses too soon: while the wire crosses its hysteresis, it does not move",
}


class SimulatedTick(NamedTuple):
    """One simulated tick: time, setpoint, displacement and temperature of the wire, power, and the largest power."""

    time_s: float
    setpoint_mm: float
    reached_mm: float
    temperature_c: float
    power_w: float
    limit_w: float


@dataclass(frozen=True)
class Feasibility:
    """The result of a simulated run of a reference.

    feasible                   True if the largest error is at most `TOLERANCE` strokes
    nearest                    reference that the wire can follow: the given reference if it is feasible
    shortfall_mm, at_s         largest error; its time
    limit, in_approach         cause of the largest error; True if its time is in the approach
    setpoint_mm_per_s          mean rate of the setpoint while the wire fell behind
    reached_mm_per_s           mean rate of the wire while it fell behind
    hottest_c, sections_c      highest temperature of the run; sections of its temperature path
    stroke_mm, span_mm         stroke of the wire; span of the reference after its approach
    scored_s, speed_mm_per_s   duration and mean speed of the reference after its approach
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

    def __str__(self) -> str:
        """Return one sentence for the user."""
        percent = 100.0 * self.shortfall_mm / self.stroke_mm
        if self.feasible:
            error = f"an error of at most {percent:.1f} % of the stroke"
            return f"feasible with {error} and a highest temperature of {self.hottest_c:.0f} °C"
        return (
            f"at {self.at_s:.1f} s the error is {self.shortfall_mm:.2g} mm ({percent:.0f} % of the stroke): the "
            f"reference moves at {self.setpoint_mm_per_s:+.2g} mm/s, the wire at {self.reached_mm_per_s:+.2g} mm/s; "
            f"{REASONS[self.limit]}"
        )

    def check(self, temperature_max_c: float, *, smooth: bool, smooth_option: str) -> None:
        """Raise ConfigError when the reference is not feasible, or needs a temperature above the limit.

        With `smooth` the nearest feasible reference is tracked instead, and only its temperature is checked. The cure
        of the error contains `smooth_option`: the option of the command line, or the argument in Python, that requests
        the nearest feasible reference.
        """
        if not (self.feasible or smooth):
            cure = f"{self._first_cure()}run the nearest reference that the wire can follow ({smooth_option})"
            raise ConfigError(str(self), where="reference", cure=cure)
        if self.hottest_c > temperature_max_c:
            raise ConfigError(
                "needs a wire temperature above temperature_max_c",
                where="reference",
                value=f"{self.hottest_c:.0f} °C",
                limit=f"{temperature_max_c:g} °C",
                cure="lower the highest displacement, or raise temperature_max_c if the data sheet allows it",
            )

    def _first_cure(self) -> str:
        """Return the beginning of the cure for a reference that is not feasible; "" for a jump."""
        if self.at_s == 0.0:
            return "check that the model belongs to this wire, and that its displacements are in mm, or "
        if self.in_approach and self.limit == "cooling":
            return "let the wire cool first, because it is still hot (in Python: rig.cool_down(60)), or "
        return "" if self.slower > JUMP else f"slow the reference down about {self.slower:.1f} times, or "


def simulate_run(
    reference: Reference, wire: WireModel, inverse: DisplacementInverse, settings: TrackingSettings, start: WireState
) -> Feasibility:
    """Simulate a run of `reference` on the model of the wire, from the state `start`, and return its result."""
    slow_wire = WireModel(wire.model, replace(wire.balance, loss_w_per_k=(1.0 - MARGIN) * wire.balance.loss_w_per_k))
    weak_a, sensor = (1.0 - MARGIN) * settings.current_limit_a, DisplacementFrom.SENSOR
    weak = replace(settings, current_limit_a=weak_a, displacement_from=sensor)
    ticks = np.array(list(_ticks(reference, slow_wire, inverse, weak, start)))
    return _judge(reference, ticks, wire.travel_mm)


def _ticks(
    reference: Reference, wire: WireModel, inverse: DisplacementInverse, settings: TrackingSettings, state: WireState
) -> Iterator[SimulatedTick]:
    """Yield the ticks of the run. As in the real loop, a command acts one period after its measurement."""
    controller = TrackingController(reference, wire, inverse, settings)
    dt_s = settings.period_s
    reading_c, in_force_a, sent_a = state.temperature_c, 0.0, 0.0
    simulated_s = float(reference.times_s[-1]) + (min(reference.repeats, CYCLES) - 1) * reference.cycle_s
    for number in range(int(simulated_s / dt_s) + 1):
        ohm = wire.resistance_ohm(state.hysteresis, state.temperature_c)
        sample = Measurement(number * dt_s, reading_c, in_force_a, in_force_a * ohm, state.hysteresis.y)
        command = controller.update(sample.time_s, sample, dt_s)
        yield SimulatedTick(
            sample.time_s,
            command.setpoint_mm,
            state.hysteresis.y,
            state.temperature_c,
            in_force_a**2 * ohm,
            settings.current_limit_a**2 * ohm,
        )
        in_force_a, sent_a = sent_a, command.commanded_a
        for _ in range(SUBSTEPS):
            before_c = state.temperature_c
            state = wire.step(
                state, in_force_a**2 * wire.resistance_ohm(state.hysteresis, state.temperature_c), dt_s / SUBSTEPS
            )
            reading_c = wire.balance.step_thermocouple(reading_c, before_c, state.temperature_c, dt_s / SUBSTEPS)


def _judge(reference: Reference, ticks: FloatArray, travel_mm: float) -> Feasibility:
    stroke_mm = abs(travel_mm)
    time_s, setpoint_mm, reached_mm, temperature_c, power_w, limit_w = ticks.T
    missed_mm = np.abs(setpoint_mm - reached_mm)
    worst = int(np.argmax(missed_mm))
    feasible = bool(missed_mm[worst] <= TOLERANCE * stroke_mm)
    begins = int(np.max(np.flatnonzero(missed_mm[: worst + 1] < 0.1 * missed_mm[worst]), initial=0))
    span = slice(begins, max(worst, begins + 1) + 1)
    duration_s = float(time_s[span][-1] - time_s[span][0])
    scored = reference.times_s >= reference.scored_from_s
    scored_mm, scored_s = reference.displacement_mm[scored], float(np.ptp(reference.times_s[scored]))
    nearest = Reference(time_s, reached_mm, reference.scored_from_s, endless=reference.endless)
    return Feasibility(
        feasible=feasible,
        nearest=reference if feasible else nearest,
        shortfall_mm=float(missed_mm[worst]),
        stroke_mm=stroke_mm,
        at_s=float(time_s[worst]),
        limit=_limit(power_w[span], limit_w[span]),
        setpoint_mm_per_s=float(setpoint_mm[span][-1] - setpoint_mm[span][0]) / duration_s,
        reached_mm_per_s=float(reached_mm[span][-1] - reached_mm[span][0]) / duration_s,
        hottest_c=float(temperature_c.max()),
        in_approach=bool(time_s[worst] < reference.scored_from_s),
        scored_s=scored_s,
        span_mm=float(np.ptp(scored_mm)),
        speed_mm_per_s=float(np.abs(np.diff(scored_mm)).sum()) / scored_s if scored_s else 0.0,
        hot_start_mm=float(scored_mm[0]) if _begins_hot(scored_mm, travel_mm) else None,
        sections_c=sections_of(temperature_c, STEADY_C),
    )


def _begins_hot(path_mm: FloatArray, travel_mm: float) -> bool:
    """Return True if a path begins at the end of its span that the wire reaches when it is hot."""
    hot_mm = path_mm.max() if travel_mm > 0 else path_mm.min()
    return bool(abs(path_mm[0] - hot_mm) < AT_END * np.ptp(path_mm))


def _limit(power_w: FloatArray, limit_w: FloatArray) -> Limit:
    """Return the limit that was active for most of the time in which the wire fell behind; without one: hysteresis."""
    if np.mean(power_w <= 0.0) > 0.5:
        return "cooling"
    return "heater" if np.mean(power_w >= 0.99 * limit_w) > 0.5 else "hysteresis"
