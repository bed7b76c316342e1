"""Feasibility of a reference: a simulated run on the identified wire, before the run on the real one.

The same controller tracks the reference on the model of the wire, in simulated time, without noise. The displacement
that the model reaches is the nearest feasible reference: cooling is limited by the surroundings, heating by the heater.
The simulated wire cools more slowly by `MARGIN`, and its heater is weaker by `MARGIN`, so that the controller of the
real wire keeps a reserve.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from smadrive.control.controllers.tracking import DISPLACEMENT_NOISE, TrackingController, TrackingSettings
from smadrive.control.feedforward.displacement import DisplacementInverse
from smadrive.control.references.reference import Reference
from smadrive.errors import ConfigError
from smadrive.measurement import Measurement
from smadrive.wire.wire_model import WireModel, WireState

Array = NDArray[np.float64]
Limit = Literal["cooling", "heater", "hysteresis"]

MARGIN = 0.1
"""Share by which the simulated wire cools and heats less than the identified one."""

TOLERANCE = 0.02
"""Largest shortfall of a feasible reference, in strokes; the controller corrects it."""

SUBSTEPS = 3
"""Steps of the wire per period of the loop."""

JUMP = 20.0
"""A reference that is so many times too fast has a jump; slowing it down does not help."""

VISIBLE = 6.0
"""A reference that moves less than this many standard deviations of the displacement sensor is lost in its noise."""

REASONS: dict[Limit, str] = {
    "cooling": "with no current at all the wire cools no faster",
    "heater": "the largest current heats no faster",
    "hysteresis": "it turns too soon: on its way from one branch to the other the wire does not move",
}


class SimulatedTick(NamedTuple):
    """One tick: time, setpoint and reached displacement, wire temperature, power and its upper limit."""

    time_s: float
    setpoint_mm: float
    reached_mm: float
    temperature_c: float
    power_w: float
    limit_w: float


@dataclass(frozen=True)
class Feasibility:
    """The result of a simulated run.

    `nearest` is the reference that the wire can follow (the given one if it is feasible). At `at_s` the wire is
    `shortfall_mm` away from the setpoint, because of `limit`; the rates of setpoint and wire there are
    `setpoint_mm_per_s` and `reached_mm_per_s`. `hottest_c` is the highest temperature of the run, `span_mm` the span of
    the reference after its approach.
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
    span_mm: float

    @property
    def caveats(self) -> tuple[str, ...]:
        """Reasons to doubt that the run is the intended one, one sentence each."""
        caveats = []
        if 0.0 < self.span_mm < VISIBLE * DISPLACEMENT_NOISE * self.stroke_mm:
            small = f"the reference moves by {self.span_mm:.2g} mm only, of a stroke of {self.stroke_mm:.3g} mm"
            caveats.append(f"{small}: that is lost in the noise of a displacement sensor; is it in mm?")
        if not self.feasible:
            caveats.append(f"smoothed, and every error is against the smoothed reference, not the given one: {self}")
        return tuple(caveats)

    @property
    def slower(self) -> float:
        """The factor, approximately, by which the reference must be slowed down."""
        return max(1.1, abs(self.setpoint_mm_per_s) / max(abs(self.reached_mm_per_s), 1e-3 * self.stroke_mm))

    def __str__(self) -> str:
        """One sentence for the user."""
        percent = 100.0 * self.shortfall_mm / self.stroke_mm
        if self.feasible:
            return f"feasible: the wire is at most {percent:.1f} % of its stroke away, and {self.hottest_c:.0f} °C hot"
        return (
            f"at {self.at_s:.1f} s the wire is {self.shortfall_mm:.2g} mm ({percent:.0f} % of its stroke) away: wanted "
            f"are {self.setpoint_mm_per_s:+.2g} mm/s, the wire does {self.reached_mm_per_s:+.2g} mm/s; "
            f"{REASONS[self.limit]}"
        )

    def check(self, temperature_max_c: float, *, smooth: bool = False) -> None:
        """Raise ConfigError when the reference is not feasible, or needs a wire above the limit.

        With `smooth` the nearest feasible reference runs instead, and only its temperature is checked.
        """
        if not (self.feasible or smooth):
            cure = "" if self.slower > JUMP else f"slow it down about {self.slower:.1f} times, or "
            raise ConfigError(f"reference: {self}: {cure}run the nearest that the wire can follow (--smooth)")
        if self.hottest_c > temperature_max_c:
            raise ConfigError(
                f"reference: it takes a wire of {self.hottest_c:.0f} °C, temperature_max_c = {temperature_max_c:g}: "
                "lower its highest displacement, or raise the limit if the wire bears it"
            )


def simulate_run(
    reference: Reference, wire: WireModel, inverse: DisplacementInverse, settings: TrackingSettings, start: WireState
) -> Feasibility:
    """Track `reference` on the model of the wire, from `start`."""
    balance = replace(wire.balance, loss_w_per_k=(1.0 - MARGIN) * wire.balance.loss_w_per_k)
    slow_wire = WireModel(wire.model, balance)
    weak = replace(settings, current_limit_a=(1.0 - MARGIN) * settings.current_limit_a)
    ticks = np.array(list(_ticks(reference, slow_wire, inverse, weak, start)))
    return _judge(reference, ticks, abs(wire.travel_mm))


def _ticks(
    reference: Reference, wire: WireModel, inverse: DisplacementInverse, settings: TrackingSettings, state: WireState
) -> Iterator[SimulatedTick]:
    """The ticks of the run, with the loop's delay: a command acts one period after its measurement."""
    controller = TrackingController(reference, wire, inverse, settings)
    dt_s = settings.period_s
    reading_c, in_force_a, sent_a = state.temperature_c, 0.0, 0.0
    for number in range(int(reference.times_s[-1] / dt_s) + 1):
        ohm = wire.resistance_ohm(state.hysteresis)
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
            state = wire.step(state, in_force_a**2 * wire.resistance_ohm(state.hysteresis), dt_s / SUBSTEPS)
            reading_c = wire.balance.step_thermocouple(reading_c, before_c, state.temperature_c, dt_s / SUBSTEPS)


def _judge(reference: Reference, ticks: Array, stroke_mm: float) -> Feasibility:
    time_s, setpoint_mm, reached_mm, temperature_c, power_w, limit_w = ticks.T
    missed_mm = np.abs(setpoint_mm - reached_mm)
    worst = int(np.argmax(missed_mm))
    feasible = bool(missed_mm[worst] <= TOLERANCE * stroke_mm)
    begins = int(np.max(np.flatnonzero(missed_mm[: worst + 1] < 0.1 * missed_mm[worst]), initial=0))
    span = slice(begins, max(worst, begins + 1) + 1)
    duration_s = float(time_s[span][-1] - time_s[span][0])
    nearest = Reference(time_s, reached_mm, reference.scored_from_s, endless=reference.endless)
    return Feasibility(
        feasible,
        reference if feasible else nearest,
        float(missed_mm[worst]),
        stroke_mm,
        float(time_s[worst]),
        _limit(power_w[span], limit_w[span]),
        float(setpoint_mm[span][-1] - setpoint_mm[span][0]) / duration_s,
        float(reached_mm[span][-1] - reached_mm[span][0]) / duration_s,
        float(temperature_c.max()),
        float(np.ptp(reference.displacement_mm[reference.times_s >= reference.scored_from_s])),
    )


def _limit(power_w: Array, limit_w: Array) -> Limit:
    """The limit that was active for most of the time in which the wire fell behind."""
    if np.mean(power_w <= 0.0) > 0.5:
        return "cooling"
    return "heater" if np.mean(power_w >= 0.99 * limit_w) > 0.5 else "hysteresis"
