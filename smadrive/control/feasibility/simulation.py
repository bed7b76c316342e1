"""A simulated run of a reference on the identified wire, before the run on the real wire.

The controller of the real run tracks the reference on the model of the wire, in simulated time, without noise. The
surroundings limit the cooling, and the heater limits the heating. The displacement that the model reaches is the
nearest feasible reference. The simulated wire cools more slowly by the share `MARGIN`, and its largest current is lower
by the same share, so that the controller of the real wire keeps a reserve.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from smadrive.control.controllers.tracking import TrackingController
from smadrive.control.controllers.tracking_feedback import TrackingSettings
from smadrive.control.feasibility.feasibility import TOLERANCE, Feasibility, Limit
from smadrive.control.feedforward.displacement import DisplacementInverse
from smadrive.control.references.reference import Reference
from smadrive.measurement import DisplacementFrom, Measurement
from smadrive.numerics.arrays import FloatArray
from smadrive.wire.recorded_loops import sections_of
from smadrive.wire.wire_model import WireModel, WireState

MARGIN = 0.1
"""Share by which the simulated heat loss and the simulated largest current are reduced."""

CYCLES = 3
"""Largest number of simulated cycles of a repeated reference; all later cycles are like the last simulated cycle."""

SUBSTEPS = 3
"""Number of simulation steps of the wire per period of the loop."""

AT_END = 0.05
"""A path begins at an end of its span if its first value is nearer to this end than this share of the span."""

STEADY_C = 1.0
"""A reversal of the temperature by less than twice this value, K, does not begin a new section."""


class SimulatedTick(NamedTuple):
    """One simulated tick: time, setpoint, displacement and temperature of the wire, power, and the largest power."""

    time_s: float
    setpoint_mm: float
    reached_mm: float
    temperature_c: float
    power_w: float
    limit_w: float


def simulate_run(
    reference: Reference,
    wire: WireModel,
    inverse: DisplacementInverse,
    settings: TrackingSettings,
    start: WireState,
    tolerance: float = TOLERANCE,
) -> Feasibility:
    """Simulate a run of `reference` on the model of the wire, from the state `start`, and return its result.

    `tolerance` is the largest error of a feasible reference, in strokes.
    """
    slow_wire = WireModel(wire.model, replace(wire.balance, loss_w_per_k=(1.0 - MARGIN) * wire.balance.loss_w_per_k))
    weak_a, sensor = (1.0 - MARGIN) * settings.current_limit_a, DisplacementFrom.SENSOR
    weak = replace(settings, current_limit_a=weak_a, displacement_from=sensor)
    ticks = np.array(list(_ticks(reference, slow_wire, inverse, weak, start)))
    return _judge(reference, ticks, wire.travel_mm, tolerance)


def _ticks(
    reference: Reference, wire: WireModel, inverse: DisplacementInverse, settings: TrackingSettings, state: WireState
) -> Iterator[SimulatedTick]:
    """Yield the ticks of the run. As in the real loop, a command acts one period after its measurement."""
    controller = TrackingController(reference, wire, inverse, settings)
    dt_s = settings.period_s
    reading_c, in_force_a, sent_a = state.temperature_c, 0.0, 0.0
    simulated_s = float(reference.times_s[-1]) + (_simulated_cycles(reference) - 1) * reference.cycle_s
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


def _judge(reference: Reference, ticks: FloatArray, travel_mm: float, tolerance: float) -> Feasibility:
    stroke_mm = abs(travel_mm)
    time_s, setpoint_mm, reached_mm, temperature_c, power_w, limit_w = ticks.T
    missed_mm = np.abs(setpoint_mm - reached_mm)
    worst = int(np.argmax(missed_mm))
    feasible = bool(missed_mm[worst] <= tolerance * stroke_mm)
    begins = int(np.max(np.flatnonzero(missed_mm[: worst + 1] < 0.1 * missed_mm[worst]), initial=0))
    span = slice(begins, max(worst, begins + 1) + 1)
    duration_s = float(time_s[span][-1] - time_s[span][0])
    scored = reference.times_s >= reference.scored_from_s
    scored_mm, scored_s = reference.displacement_mm[scored], float(np.ptp(reference.times_s[scored]))
    return Feasibility(
        feasible=feasible,
        nearest=reference if feasible else _reached(reference, time_s, reached_mm),
        shortfall_mm=float(missed_mm[worst]),
        stroke_mm=stroke_mm,
        at_s=float(time_s[worst]),
        limit=_limit(power_w[span], limit_w[span]),
        setpoint_mm_per_s=float(setpoint_mm[span][-1] - setpoint_mm[span][0]) / duration_s,
        reached_mm_per_s=float(reached_mm[span][-1] - reached_mm[span][0]) / duration_s,
        hottest_c=float(temperature_c.max()),
        in_approach=bool(time_s[worst] < reference.scored_from_s),
        scored_from_s=reference.scored_from_s,
        scored_s=scored_s,
        span_mm=float(np.ptp(scored_mm)),
        speed_mm_per_s=float(np.abs(np.diff(scored_mm)).sum()) / scored_s if scored_s else 0.0,
        hot_start_mm=float(scored_mm[0]) if _begins_hot(scored_mm, travel_mm) else None,
        sections_c=sections_of(temperature_c, STEADY_C),
    )


def _simulated_cycles(reference: Reference) -> int:
    return min(reference.repeats, CYCLES)


def _reached(reference: Reference, time_s: FloatArray, reached_mm: FloatArray) -> Reference:
    """Return the path that the wire has reached, as a reference with as many cycles as the simulated one.

    The cycle of a repeated reference is the last simulated cycle, because the wire repeats this path in all later ones.
    A new approach leads to its beginning. The remaining distance between its ends is spread over the cycle.
    """
    if reference.repeats == 1:
        return Reference(time_s, reached_mm, reference.scored_from_s, endless=reference.endless)
    begins_s = reference.scored_from_s + (_simulated_cycles(reference) - 1) * reference.cycle_s
    samples = max(2, round(reference.cycle_s / (time_s[1] - time_s[0]))) + 1
    of_cycle_s = np.linspace(0.0, reference.cycle_s, samples)
    path_mm = np.interp(begins_s + of_cycle_s, time_s, reached_mm)
    path_mm += np.linspace(0.0, path_mm[0] - path_mm[-1], samples)
    cycle = Reference(of_cycle_s, path_mm).with_approach(float(reached_mm[0]), reference.scored_from_s)
    return replace(cycle, repeats=reference.repeats)


def _begins_hot(path_mm: FloatArray, travel_mm: float) -> bool:
    """Return True if a path begins at the end of its span that the wire reaches when it is hot."""
    hot_mm = path_mm.max() if travel_mm > 0 else path_mm.min()
    return bool(abs(path_mm[0] - hot_mm) < AT_END * np.ptp(path_mm))


def _limit(power_w: FloatArray, limit_w: FloatArray) -> Limit:
    """Return the limit that was active for most of the time in which the wire fell behind; without one: hysteresis."""
    if np.mean(power_w <= 0.0) > 0.5:
        return "cooling"
    return "heater" if np.mean(power_w >= 0.99 * limit_w) > 0.5 else "hysteresis"
