"""The simulated TCLab is a voltage source: the current depends on every resistance of the circuit."""

import pytest

from firmware_sim.bench import simulated_device
from smadrive.devices.profile.profile import load_profile


def test_corroded_contact_lowers_the_current_of_a_tclab(config):
    device = simulated_device(config, profile=load_profile("tclab"))
    bench, plant = device.bench, device.bench.plant
    device.responder.answer(b"Q1 30")
    bench.advance_to(0.01)
    before_a, before_v = plant.current_a, plant.voltage_v
    plant.faults.corrode_contact(plant.resistance_ohm)
    bench.advance_to(0.02)
    assert plant.current_a == pytest.approx(before_a / 2, rel=0.01)
    assert plant.voltage_v == pytest.approx(before_v, rel=0.01)


def test_leads_do_not_change_the_full_scale_of_a_tclab(config):
    leads = config.model_copy(update={"sense": config.sense.model_copy(update={"lead_ohm": 4.0})})
    device = simulated_device(leads, profile=load_profile("tclab"))
    device.responder.answer(b"Q1 100")
    device.bench.advance_to(0.01)
    assert device.bench.plant.current_a == pytest.approx(config.board.supply_limit_a, rel=0.01)
