"""A heat balance that cannot belong to the rig's wire is an error before anything is heated."""

from dataclasses import replace

import pytest

from firmware_sim.bench import simulated_device
from firmware_sim.config import load_sim
from smadrive.clock import VirtualClock
from smadrive.control.feedforward.displacement import HysteresisInverse
from smadrive.control.references.shapes import sine
from smadrive.errors import ConfigError
from smadrive.hysteresis import DuhemModel
from smadrive.rig.checks.limits import check_same_wire
from smadrive.rig.config import load_rig
from smadrive.rig.rig import Rig
from smadrive.wire.data_sheet import load_data_sheet
from smadrive.wire.wire_model import WireModel

NAME = "flexinol-lt-0.15mm"
NOMINAL = load_data_sheet(NAME).heat_balance()
WIRE = DuhemModel.gaussian(
    mu_heating=90, mu_cooling=70, sigma_heating=5, sigma_cooling=5, scale=12, input_range=(20, 130)
)


@pytest.mark.parametrize(
    ("name", "times"),
    [
        ("heat_capacity_j_per_k", 1 / 2.6),
        ("heat_capacity_j_per_k", 2.6),
        ("loss_w_per_k", 1 / 2.0),
        ("loss_w_per_k", 2.0),
        ("latent_heat_j", 0.0),
        ("latent_heat_j", 4.5),
        ("resistance_cold_ohm", 1.5),
        ("resistance_change", -2.0),
        ("thermocouple_lag_s", 0.0),
        ("thermocouple_lag_s", 9.0),
        ("ambient_c", 1.7),
    ],
)
def test_balance_that_differs_as_wires_do_is_accepted(name, times):
    check_same_wire(replace(NOMINAL, **{name: times * getattr(NOMINAL, name)}), NOMINAL, NAME)


@pytest.mark.parametrize(
    ("name", "times"),
    [
        ("heat_capacity_j_per_k", 0.1),
        ("heat_capacity_j_per_k", 10.0),
        ("loss_w_per_k", 0.1),
        ("loss_w_per_k", 10.0),
        ("latent_heat_j", 10.0),
        ("resistance_cold_ohm", 0.1),
        ("resistance_cold_ohm", 10.0),
        ("resistance_change", 9.0),
        ("thermocouple_lag_s", 100.0),
        ("thermocouple_lag_s", 1000.0),
        ("ambient_c", 13.4),
    ],
)
def test_value_in_another_unit_is_an_error_with_both_values(name, times):
    value = times * getattr(NOMINAL, name)
    with pytest.raises(ConfigError, match=name) as caught:
        check_same_wire(replace(NOMINAL, **{name: value}), NOMINAL, NAME)
    assert caught.value.value == f"{value:.4g}"
    assert caught.value.limit
    assert caught.value.cure
    assert NAME in caught.value.what
    assert f"{getattr(NOMINAL, name):.4g}" in caught.value.what


def test_wire_file_without_latent_heat_and_lag_bounds_them_nevertheless():
    plain = replace(NOMINAL, latent_heat_j=0.0, thermocouple_lag_s=0.0)
    check_same_wire(replace(plain, latent_heat_j=0.5, thermocouple_lag_s=0.5), plain, NAME)
    for far in ({"latent_heat_j": 5.0}, {"thermocouple_lag_s": 5.0}):
        with pytest.raises(ConfigError, match=next(iter(far))):
            check_same_wire(replace(plain, **far), plain, NAME)


def test_rig_does_not_heat_with_the_balance_of_another_wire():
    device = simulated_device(load_sim(NAME), seed=3)
    clock = VirtualClock()
    clock.follow(device.bench.advance_to)
    reference = sine(low_mm=2.0, high_mm=9.0, period_s=40.0, cycles=1.0).with_approach(0.0, 10.0)
    slow = replace(NOMINAL, thermocouple_lag_s=150.0)
    heated_a = []
    clock.follow(lambda _: heated_a.append(device.bench.plant.current_a))
    with (
        pytest.raises(ConfigError, match="thermocouple_lag_s"),
        Rig(load_rig("in-process"), transports={"board": device.transport(clock)}) as rig,
    ):
        rig.track(reference, WireModel(WIRE, slow), HysteresisInverse(WIRE), lambda tick: None)
    assert heated_a
    assert max(heated_a) == 0.0
