"""The heat balance against an ODE solver, and its inverse against itself."""

import dataclasses

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from smadrive.errors import ModelError
from smadrive.wire.heat_balance import HeatBalance

WIRE = HeatBalance(0.029, 0.012, 0.83, 22.0, 16.5, -0.12, 0.15)


def test_step_is_the_exact_solution_of_the_heat_balance():
    def rate(_, state):
        wire, reading = state
        return [
            (1.4 - WIRE.loss_w_per_k * (wire - WIRE.ambient_c)) / WIRE.heat_capacity_j_per_k,
            (wire - reading) / WIRE.thermocouple_lag_s,
        ]

    exact = solve_ivp(rate, (0, 2.0), [30.0, 25.0], rtol=1e-10, atol=1e-10).y[:, -1]
    wire = reading = None
    wire, reading = 30.0, 25.0
    for _ in range(2000):
        after = WIRE.step(wire, 1.4, 0.0, 1e-3)
        reading, wire = WIRE.step_thermocouple(reading, wire, after, 1e-3), after
    assert wire == pytest.approx(exact[0], abs=1e-6)
    assert reading == pytest.approx(exact[1], abs=1e-5)


def test_cooling_time_is_that_of_the_exact_solution():
    time_s = WIRE.cooling_s(95.0, 70.0)
    assert WIRE.step(95.0, 0.0, 0.0, time_s) == pytest.approx(70.0)
    assert WIRE.cooling_s(70.0, 70.0) == WIRE.cooling_s(60.0, 70.0) == 0.0
    assert WIRE.cooling_s(70.0, WIRE.ambient_c) == float("inf")


def test_latent_heat_slows_the_wire_as_a_larger_capacity_would():
    slope_per_k = 0.05
    heavier = dataclasses.replace(WIRE, heat_capacity_j_per_k=0.029 + 0.83 * slope_per_k)
    assert WIRE.step(60.0, 2.0, slope_per_k, 0.1) == pytest.approx(heavier.step(60.0, 2.0, 0.0, 0.1))


def test_inverse_gives_the_power_that_holds_a_ramp():
    temperature, dt_s = 40.0, 1e-4
    for _ in range(1000):
        temperature = WIRE.step(temperature, WIRE.power_w(temperature, 5.0, 0.0), 0.0, dt_s)
    assert temperature == pytest.approx(40.5, abs=1e-3)


def test_current_heats_with_the_resistance_of_the_phase():
    current_a = WIRE.current_a(2.0, phase=0.5)
    assert current_a**2 * WIRE.resistance_ohm(0.5) == pytest.approx(2.0)
    assert WIRE.current_a(-3.0, phase=0.5) == 0.0


def test_thermocouple_without_lag_reads_the_wire():
    assert dataclasses.replace(WIRE, thermocouple_lag_s=0.0).step_thermocouple(20.0, 50.0, 51.0, 0.05) == 51.0


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("heat_capacity_j_per_k", 0.0),
        ("heat_capacity_j_per_k", np.inf),
        ("loss_w_per_k", -1.0),
        ("latent_heat_j", np.nan),
        ("ambient_c", np.nan),
        ("resistance_change", -1.0),
    ],
)
def test_impossible_parameter_is_rejected_by_name(field, value):
    with pytest.raises(ModelError) as error:
        dataclasses.replace(WIRE, **{field: value})
    assert error.value.where == f"heat balance: {field}"
