"""Random wires are excited, identified and tracked by a controller that does not know their parameters.

These are a few of the many of tests/benchmarks/control.toml.
"""

from typing import NamedTuple

import numpy as np
import pytest

from firmware_sim.bench import simulated_device
from firmware_sim.config import SimConfig, load_sim
from firmware_sim.physics.random_wire import random_wire
from smadrive.clock import VirtualClock
from smadrive.control.feedforward.displacement import HysteresisInverse
from smadrive.control.references.shapes import sine
from smadrive.identification.excitation import ExcitationRecord
from smadrive.identification.wire import WireFit, identify_wire
from smadrive.rig.config import load_rig
from smadrive.rig.rig import Rig
from smadrive.wire.wire_model import WireModel, travel_mm

pytestmark = pytest.mark.exhaustive


class RandomWire(NamedTuple):
    """The true parameters of a wire, and their identification."""

    sim: SimConfig
    fit: WireFit


class SimulatedRig:
    """The in-process rig with this wire on it."""

    def __init__(self, sim, seed):
        device = simulated_device(sim, seed=seed)
        clock = VirtualClock()
        clock.follow(device.bench.advance_to)
        self.plant = device.bench.plant
        self.rig = Rig(load_rig("in-process"), transports={"board": device.transport(clock)})


def _without_leads(sim):
    """Return the sim of the wire without leads. Its resistance depends on the phase alone, as in the heat balance."""
    return sim.model_copy(update={"resistance": None, "sense": sim.sense.model_copy(update={"lead_ohm": 0.0})})


@pytest.fixture(
    scope="module",
    params=[("duhem", 11), ("two-component", 12), ("preisach", 13)],
    ids=lambda p: p[0],
)
def wire(request):
    kind, seed = request.param
    sim = _without_leads(random_wire(load_sim("flexinol-lt-0.15mm"), seed, kind))
    rows = []
    with SimulatedRig(sim, seed).rig as rig:
        rig.excite(rig.excitation(22.0), lambda tick: rows.append((tick.time_s, tick.measurement)))
        nominal = rig.nominal_balance
    columns = [(t, m.current_a, m.voltage_v, m.temperature_c, m.displacement_mm) for t, m in rows]
    return RandomWire(sim, identify_wire(ExcitationRecord(*np.array(columns).T), nominal))


def test_identification_recovers_the_parameters_within_bounds(wire):
    true, thermal = wire.sim.wire, wire.fit.thermal
    preisach = wire.sim.transformation.kind == "preisach"
    for name, value, bound in (
        ("heat_capacity_j_per_k", true.heat_capacity_j_per_k, 0.02),
        ("loss_w_per_k", true.loss_w_per_k, 0.01),
        ("latent_heat_j", true.mass_kg * true.latent_heat_j_per_kg, 0.03),
        ("resistance_cold_ohm", true.resistance_cold_ohm, 0.005),
        ("resistance_change", true.resistance_change, 0.02),
    ):
        assert getattr(thermal.balance, name) == pytest.approx(value, rel=bound), name
        assert thermal.within[name] <= 0.01, name
    assert wire.fit.hysteresis.rms_percent < (1.5 if preisach else 0.5)
    assert wire.fit.hysteresis.certificate.turned_share < 1e-6
    cold_mm, hot_mm = travel_mm(wire.fit.hysteresis.model)
    assert hot_mm - cold_mm == pytest.approx(true.stroke_mm, rel=0.03)


@pytest.mark.parametrize("sensor", [False, True], ids=["without sensor", "with sensor"])
def test_wire_is_tracked_within_the_targets(wire, sensor):
    model, balance = wire.fit.hysteresis.model, wire.fit.thermal.balance
    cold_mm, hot_mm = travel_mm(model)
    low_mm, high_mm = cold_mm + 0.2 * (hot_mm - cold_mm), cold_mm + 0.8 * (hot_mm - cold_mm)
    reference = sine(low_mm=low_mm, high_mm=high_mm, period_s=1 / 0.0178, cycles=1.5).with_approach(cold_mm, 10.0)
    simulated = SimulatedRig(wire.sim if sensor else wire.sim.model_copy(update={"displacement": None}), seed=3)
    rows = []
    with simulated.rig as rig:
        rig.track(
            reference,
            WireModel(model, balance),
            HysteresisInverse(model),
            lambda tick: rows.append((tick.time_s, tick.command.setpoint_mm, simulated.plant.displacement_mm)),
        )
    time_s, setpoint_mm, reached_mm = np.array(rows).T
    percent = 100 * (setpoint_mm - reached_mm)[time_s >= 10.0] / wire.sim.wire.stroke_mm
    rms, largest = float(np.sqrt(np.mean(percent**2))), float(np.max(np.abs(percent)))
    if wire.sim.transformation.kind == "preisach":
        assert rms <= (0.5 if sensor else 4.0)
    else:
        assert rms <= (0.25 if sensor else 1.0)
        assert largest <= (1.0 if sensor else 2.5)
