"""Which rigs may take the displacement from the resistance: refused or warned before the wire is heated."""

import dataclasses

import pytest

from smadrive.devices.profile.profile import load_profile
from smadrive.errors import ConfigError
from smadrive.hysteresis import DuhemModel
from smadrive.measurement import DisplacementFrom
from smadrive.rig.checks.sensing import (
    check_sensing,
    resolution,
    usable_checks,
    usable_wire,
)
from smadrive.rig.config import DeviceConfig
from smadrive.rig.planned_device import PlannedDevice
from smadrive.rig.supervision import WireChecks
from smadrive.wire.health.expected_rest import ExpectedRest
from smadrive.wire.heat_balance import HeatBalance
from smadrive.wire.identified_resistance import WireResistance
from smadrive.wire.observability import COARSE, TOO_COARSE, resolution_error
from smadrive.wire.wire_model import WireModel

MODEL = DuhemModel.gaussian(
    mu_heating=90, mu_cooling=69, sigma_heating=5, sigma_cooling=5, scale=12, input_range=(20, 140)
)
BALANCE = HeatBalance(0.029, 0.012, 0.83, 22.0, 16.5, -0.12, 0.15)
RESISTANCE = WireResistance(70.0, 16.5, 0.0, 0.0, 0.004, 0.001, 0.0, (20.0, 80.0, 140.0), (14.5,) * 3)
WIRE = WireModel(MODEL, BALANCE, RESISTANCE)
THIN = WireModel(MODEL, dataclasses.replace(BALANCE, loss_w_per_k=0.0004), RESISTANCE)
BOARD = "sma-reference"


def source(profile):
    config = DeviceConfig(name="source", profile=profile, url="sim://flexinol-lt-0.15mm")
    return PlannedDevice(config, load_profile(profile))


def checked(chosen=DisplacementFrom.RESISTANCE, profile=BOARD, wire=WIRE, celsius=22.0, has_sensor=True):
    return check_sensing(chosen, source(profile), wire, celsius, has_sensor=has_sensor)


@pytest.mark.parametrize("chosen", [DisplacementFrom.SENSOR, DisplacementFrom.NONE])
def test_other_sources_need_no_resistance(chosen):
    assert checked(chosen, wire=WireModel(MODEL, BALANCE)) == ()


def test_cold_wire_on_the_board_is_accepted():
    assert checked() == ()


def test_model_without_resistance_is_refused():
    with pytest.raises(ConfigError) as raised:
        checked(wire=WireModel(MODEL, BALANCE))
    assert raised.value.where == "displacement_from"


def test_device_that_measures_no_current_is_refused():
    with pytest.raises(ConfigError) as raised:
        checked(profile="tclab")
    assert raised.value.where == "device 'source'"


@pytest.mark.parametrize(
    ("profile", "wire", "is_used"),
    [(BOARD, WIRE, True), ("riden-rd60xx", WIRE, True), ("riden-rd60xx", THIN, False), ("tclab", WIRE, False)],
    ids=["board", "fine supply", "coarse supply", "duty"],
)
def test_resistance_that_the_source_cannot_measure_is_not_used(profile, wire, is_used):
    used = usable_wire(wire, source(profile))
    assert (used.model, used.balance) == (wire.model, wire.balance)
    assert used.resistance is (wire.resistance if is_used else None)
    assert len(checked(DisplacementFrom.SENSOR, profile, wire)) == (0 if is_used else 1)
    assert checked(DisplacementFrom.NONE, profile, wire) == ()


@pytest.mark.parametrize(("profile", "is_checked"), [(BOARD, True), ("riden-rd60xx", True), ("tclab", False)])
def test_resistance_at_rest_is_checked_only_if_it_is_measured(profile, is_checked):
    expected = ExpectedRest(16.5, 0.03)
    used = usable_checks(WireChecks(WIRE, expected), source(profile))
    assert used.expected is (expected if is_checked else None)


def test_warm_wire_is_warned_of():
    (warning,) = checked(celsius=75.0)
    assert "75 °C" in warning


def test_run_without_a_sensor_is_told_of_the_resistance():
    (warning,) = checked(DisplacementFrom.SENSOR, has_sensor=False)
    assert '"resistance"' in warning
    assert checked(DisplacementFrom.SENSOR, has_sensor=True) == ()
    assert checked(DisplacementFrom.NONE, has_sensor=False) == ()
    assert checked(DisplacementFrom.SENSOR, wire=WireModel(MODEL, BALANCE), has_sensor=False) == ()


def test_coarse_supply_is_warned_of_with_its_error():
    assert COARSE < resolution_error(WIRE, RESISTANCE, *resolution(load_profile("riden-rd60xx"))) < TOO_COARSE
    (warning,) = checked(profile="riden-rd60xx")
    assert "3.3 % of the stroke" in warning


def test_supply_that_is_too_coarse_for_a_thin_wire_is_refused():
    assert resolution_error(WIRE, RESISTANCE, 0.01, 0.01) > TOO_COARSE
    with pytest.raises(ConfigError) as raised:
        checked(profile="riden-rd60xx", wire=THIN)
    assert "% of the stroke" in str(raised.value.value)


def test_resolution_comes_from_the_profile():
    current_a, voltage_v = resolution(load_profile(BOARD))
    assert current_a == pytest.approx(1e-4)
    assert resolution_error(WIRE, RESISTANCE, current_a, voltage_v) < COARSE


def test_a_finer_resolution_makes_a_smaller_error():
    errors = [resolution_error(WIRE, RESISTANCE, share * 0.01, share * 0.01) for share in (1.0, 0.1)]
    assert errors[1] == pytest.approx(0.1 * errors[0])
    steeper = dataclasses.replace(RESISTANCE, austenite_ohm=(12.5,) * 3)
    assert resolution_error(WIRE, steeper, 0.01, 0.01) < 0.7 * errors[0]
