"""Tracking errors of wires that the controller does not know: python tests/benchmarks/control.py --plants 50

Every plant is random. It is excited and identified like a real wire, then tracked on the in-process rig in virtual
time: without displacement, with the displacement by the resistance, and with a displacement sensor. The error is
setpoint minus true displacement after the approach, in % of the true stroke. The table gives median and worst over the
plants; plants whose hysteresis is a Preisach model have their own rows. The sine is tracked as requested. The other
references are first smoothed to the fastest possible cooling, and all controllers of a plant track the same smoothed
reference. With --disturbance, the surroundings or the load of the wire change at a random time of every run.
"""

from __future__ import annotations

import argparse
import os
from collections import defaultdict
from dataclasses import replace
from random import Random
from typing import NamedTuple

import numpy as np

from firmware_sim.bench import simulated_device
from firmware_sim.config import SimConfig, load_sim
from firmware_sim.physics.random_wire import KINDS, HysteresisKind, random_wire
from smadrive.clock import VirtualClock
from smadrive.control.controllers.temperature import Command
from smadrive.control.controllers.tracking import TrackingController
from smadrive.control.feasibility import simulate_run
from smadrive.control.feedforward.displacement import HysteresisInverse, StaticMap
from smadrive.control.references.reference import Reference
from smadrive.control.references.shapes import chirp, sine, steps, trapezoid
from smadrive.errors import SmadriveError
from smadrive.identification.excitation import ExcitationRecord
from smadrive.identification.wire import FitSettings, identify_hysteresis, identify_wire
from smadrive.measurement import DisplacementFrom
from smadrive.rig.config import load_rig
from smadrive.rig.controllers import tracking_settings
from smadrive.rig.rig import Rig
from smadrive.wire.wire_model import WireModel, WireState

APPROACH_S = 10.0
RIG = load_rig("in-process")
NOMINAL = load_sim("flexinol-lt-0.15mm")
SINE = "sine 0.0178 Hz"
DISTURBANCES = {
    "none": lambda _plant: None,
    "draft": lambda plant: plant.surroundings.draft(1.6, for_s=20.0, ramp_s=1.0),
    "warmer": lambda plant: plant.surroundings.drift_ambient(8.0, over_s=60.0),
    "colder": lambda plant: plant.surroundings.drift_ambient(-8.0, over_s=60.0),
    "more load": lambda plant: plant.load.step_load(60.0, over_s=1.0),
    "less load": lambda plant: plant.load.step_load(-60.0, over_s=1.0),
}
SOURCES = (DisplacementFrom.NONE, DisplacementFrom.RESISTANCE, DisplacementFrom.SENSOR)
CONTROLLERS = ("T-S inverse", "Duhem inverse", "no hysteresis compensation", "PID only")


class SimulatedRig:
    """The in-process rig with a random wire, with or without a displacement sensor."""

    def __init__(self, sim: SimConfig, seed: int, *, sensor: bool) -> None:
        device = simulated_device(sim if sensor else sim.model_copy(update={"displacement": None}), seed=seed)
        clock = VirtualClock()
        clock.follow(device.bench.advance_to)
        self.plant = device.bench.plant
        self.rig = Rig(RIG, transports={"board": device.transport(clock)})


class Wire(NamedTuple):
    """A random wire, its identified models, and the static map of its data."""

    sim: SimConfig
    models: dict[str, WireModel]
    plain: StaticMap


def identified(sim: SimConfig, seed: int, *, baselines: bool) -> Wire:
    """Excite a wire, and fit its heat balance and T-S model. With `baselines`, also fit a Duhem model."""
    simulated, rows = SimulatedRig(sim, seed, sensor=True), []
    with simulated.rig as rig:
        excitation = rig.excitation(rig.heater.exchange(0.0).temperature_c)
        rig.excite(excitation, lambda tick: rows.append((tick.time_s, tick.measurement)))
        nominal = rig.nominal_balance
    record = ExcitationRecord(
        *np.array([(t, m.current_a, m.voltage_v, m.temperature_c, m.displacement_mm) for t, m in rows]).T
    )
    fit = identify_wire(record, nominal)
    temperature_c, balance = fit.thermal.wire_temperature_c, fit.thermal.balance
    resistance = None if fit.resistance is None else fit.resistance.resistance
    models = {CONTROLLERS[0]: WireModel(fit.hysteresis.model, balance, resistance)}
    if baselines:
        duhem = identify_hysteresis(temperature_c, record.displacement_mm, FitSettings("duhem"))
        models[CONTROLLERS[1]] = WireModel(duhem.model, balance, resistance)
    return Wire(sim, models, StaticMap(temperature_c, record.displacement_mm))


def references(wire: WireModel, *, others: bool) -> dict[str, Reference]:
    """Return the sine between 20 and 80 % of the identified stroke. With `others`, also return the other references."""
    cold_mm, hot_mm = (wire.model.initial_state(v).y for v in wire.model.input_range)
    low_mm, high_mm = cold_mm + 0.2 * (hot_mm - cold_mm), cold_mm + 0.8 * (hot_mm - cold_mm)
    ends = {"low_mm": low_mm, "high_mm": high_mm}
    corners = np.array([0.0, 1.0, 0.3, 0.7, 0.45, 0.9, 0.1, 0.6, 0.25, 0.8, 0.0])
    times = np.concatenate(([0.0], np.cumsum(8.0 * np.abs(np.diff(corners)) + 1.0)))
    found = {SINE: sine(period_s=1.0 / 0.0178, cycles=1.5, **ends).with_approach(cold_mm, APPROACH_S)}
    if not others:
        return found
    requested = {
        "trapezoid": trapezoid(rise_s=8.0, dwell_s=5.0, cycles=2.0, **ends),
        "steps": steps(dwell_s=12.0, cycles=2.0, **ends),
        "chirp 0.01-0.1 Hz": chirp(start_hz=0.01, end_hz=0.1, duration_s=70.0, **ends),
        "minor loops": Reference.from_samples(times, low_mm + (high_mm - low_mm) * corners),
    }
    start = WireState(22.0, wire.model.initial_state(22.0))
    for name, reference in requested.items():
        path = reference.with_approach(cold_mm, APPROACH_S)
        found[name] = simulate_run(path, wire, HysteresisInverse(wire.model), tracking_settings(RIG), start).nearest
    return found


class DisplacementPid:
    """A PI controller from displacement to power, with its gain by lambda tuning at the mean slope of the loop.

    Its two time constants are the best of a sweep: shorter ones make the loop oscillate, longer ones make it lag.
    """

    CLOSED_LOOP_S = 0.05
    DELAY_S = 0.1
    INTEGRAL_S = 0.8

    def __init__(self, reference: Reference, wire: WireModel, limit_a: float) -> None:
        balance, model = wire.balance, wire.model
        inputs = np.linspace(*model.input_range, 1000)
        slopes = model.branch_slope(inputs, rising=True)
        slope_per_k = float(np.sum(slopes * np.gradient(model.branch(inputs, rising=True))))
        self.duration_s = reference.duration_s
        self._reference, self._balance, self._limit_a = reference, balance, limit_a
        capacity = balance.heat_capacity_j_per_k + balance.latent_heat_j * slope_per_k
        self._gain = capacity / (model.scale * slope_per_k * (self.CLOSED_LOOP_S + self.DELAY_S))
        self._integral_w = 0.0

    def update(self, time_s: float, measurement, dt_s: float) -> Command:
        setpoint_mm = self._reference.value_mm(time_s)
        error_mm = setpoint_mm - measurement.displacement_mm
        limit_w = self._limit_a**2 * self._balance.resistance_cold_ohm
        unclamped_w = self._gain * error_mm + self._integral_w
        power_w = min(max(unclamped_w, 0.0), limit_w)
        if power_w == unclamped_w or (unclamped_w < 0.0) == (error_mm > 0.0):
            self._integral_w += self._gain * error_mm * dt_s / self.INTEGRAL_S
        return Command(self._balance.current_a(power_w, 0.0), setpoint_mm=setpoint_mm, power_w=power_w)


def controller(name: str, wire: Wire, reference: Reference, source: DisplacementFrom):
    settings = replace(tracking_settings(RIG), displacement_from=source)
    model = wire.models.get(name, wire.models[CONTROLLERS[0]])
    if name == "PID only":
        if source is DisplacementFrom.SENSOR:
            return DisplacementPid(reference, model, settings.current_limit_a)
        settings = replace(settings, feedforward_share=0.0)
    inverse = HysteresisInverse(model.model) if name in wire.models else wire.plain
    return TrackingController(reference, model, inverse, settings)


def track(
    name: str, wire: Wire, reference: Reference, seed: int, source: DisplacementFrom, disturbance: str
) -> tuple[float, float]:
    """Return the RMS and the largest error of one run in %. Both are infinite after a trip."""
    simulated, rows = SimulatedRig(wire.sim, seed, sensor=source is DisplacementFrom.SENSOR), []
    coming = [reference.scored_from_s + Random(seed).uniform(5.0, 60.0)]

    def record(tick):
        if coming and tick.time_s >= coming[0]:
            coming.clear()
            DISTURBANCES[disturbance](simulated.plant)
        rows.append((tick.time_s, simulated.plant.displacement_mm))

    try:
        with simulated.rig as rig:
            tracking = controller(name, wire, reference, source)
            identified_wire = wire.models[CONTROLLERS[0]]
            rig.drive(tracking, identified_wire.balance, record, identified_wire.model)
    except SmadriveError as error:
        print(f"    {name}, displacement from {source}: {error}")
        return np.inf, np.inf
    time_s, reached_mm = np.array(rows).T
    setpoint_mm = np.array([reference.value_mm(t) for t in time_s])
    percent = 100.0 * (setpoint_mm - reached_mm)[time_s >= reference.scored_from_s] / wire.sim.wire.stroke_mm
    return float(np.sqrt(np.mean(percent**2))), float(np.max(np.abs(percent)))


def study(plants: int, others: int, baselines: int, seed: int, kind: HysteresisKind | None, disturbance: str):
    """Return the errors of all runs: {(wires, reference, controller, source): [(rms, max) for each plant]}."""
    results = defaultdict(list)
    for number in range(seed, seed + plants):
        compared = number < seed + baselines
        sim = random_wire(NOMINAL, number, kind)
        wires = "Preisach" if sim.transformation.kind == "preisach" else "Duhem"
        wire = identified(sim, number, baselines=compared)
        for title, reference in references(wire.models[CONTROLLERS[0]], others=number < seed + others).items():
            for name in CONTROLLERS if compared else CONTROLLERS[:1]:
                for source in SOURCES:
                    figures = track(name, wire, reference, number + 1000, source, disturbance)
                    results[wires, title, name, source].append(figures)
        latest = {source: results[wires, SINE, CONTROLLERS[0], source][-1] for source in SOURCES}
        errors = ", ".join(f"{source} {rms:.2f} / {most:.2f} %" for source, (rms, most) in latest.items())
        print(f"plant {number}, {sim.transformation.kind}: sine, RMS / max: {errors}", flush=True)
    return results


def table(results) -> None:
    print(f"\n{'% of stroke':66}{'without displacement':28}{'by resistance':28}with a sensor")
    print(f"{'wires':10}{'reference':19}{'controller':28}plants   {'RMS worst    max worst     ' * 3}")
    for wires, title, name in sorted(dict.fromkeys(key[:3] for key in results), key=lambda key: key[0]):
        cells = []
        for source in SOURCES:
            figures = np.array(results[wires, title, name, source])
            cells.append("  ".join(f"{np.median(c):5.2f} {c.max():5.2f}" for c in figures.T))
        print(f"{wires:10}{title:19}{name:28}{len(figures):5}  {'  '.join(cells)}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plants", type=int, default=6)
    parser.add_argument("--others", type=int, default=3, help="number of plants that also track the other references")
    parser.add_argument(
        "--baselines", type=int, default=1, help="number of plants on which the other controllers also run"
    )
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kind", choices=KINDS, default=None, help="kind of the plants' hysteresis; default: random")
    parser.add_argument("--disturbance", choices=DISTURBANCES, default="none")
    arguments = parser.parse_args()
    os.nice(10)
    table(study(**vars(arguments)))
