"""The filter of the temperature setpoint: between the branches, on a branch, and in a disturbance."""

import numpy as np
import pytest

from smadrive.control.estimation.innovation import DisturbanceEvidence
from smadrive.control.estimation.wire_estimate import WireEstimate
from smadrive.control.feedforward.setpoint_filter import FILTER_S, NEW_C, SetpointFilter
from smadrive.hysteresis import DuhemModel
from smadrive.hysteresis.reversal import Play
from smadrive.wire.heat_balance import HeatBalance
from smadrive.wire.wire_model import WireModel

DT_S = 0.05
LOOP, FALLING = (
    DuhemModel.gaussian(
        mu_heating=90, mu_cooling=69, sigma_heating=5, sigma_cooling=5, scale=scale, offset=offset, input_range=(0, 160)
    )
    for scale, offset in ((12, 0), (-12, 12))
)
BALANCE = HeatBalance(0.029, 0.012, 0.83, 22.0, 16.5, -0.12, 0.15)
ON_THE_HEATING_BRANCH, BETWEEN_THE_BRANCHES = (90.0,), (90.0, 86.0)
"""Temperatures through which the wire goes, °C."""


def estimate_after(model, temperatures_c, level=0.0):
    state = model.initial_state(temperatures_c[0])
    for temperature_c in temperatures_c[1:]:
        state = model.step(state, temperature_c)
    evidence = DisturbanceEvidence()._replace(level=level)
    return WireEstimate(state.v, state.v, state, 0.0, Play(state.v), evidence=evidence)


def filtered_c(model, temperatures_c, change_c, *, direction=-1, level=0.0, dt_s=DT_S, steps=1):
    wire_filter, estimate = SetpointFilter(WireModel(model, BALANCE)), estimate_after(model, temperatures_c, level)
    setpoint_c = 75.0
    for _ in range(steps):
        setpoint_c = wire_filter.update(setpoint_c, 75.0 + change_c, estimate, direction, dt_s)
    return setpoint_c - 75.0


@pytest.mark.parametrize("model", [LOOP, FALLING], ids=["rising", "falling"])
@pytest.mark.parametrize("change_c", [-2.0, 2.0])
def test_setpoint_between_the_branches_follows_with_its_time_constant(model, change_c):
    share = filtered_c(model, BETWEEN_THE_BRANCHES, change_c) / change_c
    assert share == pytest.approx(1.0 - np.exp(-DT_S / FILTER_S), rel=0.05)


@pytest.mark.parametrize("model", [LOOP, FALLING], ids=["rising", "falling"])
def test_setpoint_on_a_branch_is_not_filtered(model):
    assert filtered_c(model, ON_THE_HEATING_BRANCH, 2.0, direction=1) == pytest.approx(2.0, rel=0.01)


def test_filter_does_not_depend_on_the_period():
    coarse, fine = (filtered_c(LOOP, BETWEEN_THE_BRANCHES, 3.0, dt_s=0.1 / n, steps=n) for n in (1, 5))
    assert coarse == pytest.approx(fine, rel=0.02)


def test_large_change_is_not_filtered():
    assert filtered_c(LOOP, BETWEEN_THE_BRANCHES, 1.01 * NEW_C) == pytest.approx(1.01 * NEW_C)


def test_setpoint_in_a_disturbance_is_not_filtered():
    assert filtered_c(LOOP, BETWEEN_THE_BRANCHES, 2.0, level=1.0) == pytest.approx(2.0)
