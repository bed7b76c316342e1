"""The tuning session on the simulated wire: measuring, arming, holding, tracking, faults."""

import numpy as np
import pytest
from marks import exhaustive

from firmware_sim.bench import simulated_device
from firmware_sim.config import load_sim
from smadrive.hysteresis import PreisachPlane, TriangularSets, TSFuzzyDuhem, TSFuzzyPreisach
from smadrive.hysteresis.memory.plane import in_plane
from smadrive.tuning.page.panel import chips_html
from tests.unit.tuning.conftest import NONE_A, currents, error_mm


def test_idle_session_measures_and_does_not_heat(rig):
    rig.run(until_s=3.0)
    assert len(rig.ticks) == pytest.approx(60, abs=2)
    assert currents(rig.ticks).max() < NONE_A
    assert rig.status["mode"] == "off"
    assert len(rig.page.since(0)[1]) == rig.page.written >= 58


@pytest.mark.exhaustive
def test_armed_session_follows_a_reference_repeatedly(rig):
    arm, start = rig.at(1.0, "arm"), rig.at(2.0, "track", reference="sine")
    rig.run(until_s=140.0)
    assert rig.answers == {arm: None, start: None}
    assert rig.status["mode"] == "tracking"
    assert np.abs(error_mm(rig.between(60.0, 139.0))).max() < 0.03 * 12.0
    assert np.ptp([tick.command.setpoint_mm for tick in rig.between(100.0, 139.0)]) == pytest.approx(7.0, abs=0.1)


@pytest.mark.exhaustive
def test_turning_points_of_a_wire_with_memory_are_published(rig):
    """The cold end; then the wire rises, turns at the top of the sine, and falls."""
    wire, thresholds = rig.model, np.linspace(40.0, 110.0, 30)
    rules = TSFuzzyDuhem.from_duhem(wire, TriangularSets(tuple(np.linspace(40.0, 120.0, 11))))
    cells = in_plane(thresholds, thresholds)
    rig.model = TSFuzzyPreisach(rules, PreisachPlane(thresholds, thresholds, cells / cells.sum()), 0.1)
    rig.at(1.0, "arm")
    rig.at(2.0, "track", reference="sine")
    rig.run(until_s=20.0)
    rising = rig.status["turning_points"]
    rig.run(until_s=80.0)
    assert (rising["dropped"], rising["temperatures_c"][0]) == (0, wire.input_range[0])
    assert len(rig.status["turning_points"]["temperatures_c"]) >= 2


def test_a_wire_without_memory_has_no_turning_points(rig):
    rig.at(1.0, "arm")
    rig.run(until_s=3.0)
    assert rig.status["turning_points"] is None


@pytest.mark.exhaustive
def test_draft_and_load_that_the_observer_finds_are_published(rig):
    plant = rig.device.bench.plant
    rig.at(1.0, "arm")
    rig.at(2.0, "track", reference="sine")
    rig.run(until_s=20.0)
    assert (rig.status["cooling"], rig.status["shift_c"]) == (pytest.approx(1.0, abs=0.1), pytest.approx(0.0, abs=1.0))
    rig.do(20.0, lambda: plant.surroundings.draft(1.5, for_s=10.0))
    rig.run(until_s=28.0)
    assert rig.status["cooling"] == pytest.approx(1.5, abs=0.15)
    assert "<i>cooling</i><b>1.5 × identified" in chips_html(rig.status, "", late=False, controls=True)
    rig.do(45.0, lambda: plant.load.step_load(45.0, over_s=1.0))
    rig.run(until_s=55.0)
    assert rig.status["shift_c"] == pytest.approx(45.0 / 7.5, abs=2.0)


@pytest.mark.parametrize("seed", [0, *map(exhaustive, (1, 2, 3))])
def test_cold_wire_is_armed_without_heat_and_approaches_smoothly(rig, seed):
    rig.device = simulated_device(load_sim("flexinol-lt-0.15mm"), seed)
    rig.clock.follow(rig.device.bench.advance_to)
    rig.at(1.0, "arm")
    rig.at(5.0, "track", reference="sine")
    rig.run(until_s=15.0)
    assert rig.between(2.0, 5.0)[0].measurement.armed
    assert currents(rig.between(0.0, 5.0)).max() < NONE_A
    assert np.abs(error_mm(rig.between(5.0, 15.0))).max() < 0.01 * 12.0


@pytest.mark.parametrize("noise_seed", [0, *map(exhaustive, (1, 2))])
@pytest.mark.parametrize("zero_mm", [*map(exhaustive, (-0.6, -0.05, 0.05)), 0.6])
def test_cold_wire_is_held_without_heat_although_its_sensor_has_lost_its_zero(rig_without_zero, zero_mm, noise_seed):
    rig = rig_without_zero(zero_mm, noise_seed)
    rig.at(1.0, "arm")
    rig.run(until_s=20.0)
    assert rig.between(2.0, 20.0)[0].measurement.armed
    assert currents(rig.between(0.0, 20.0)).max() < NONE_A


def test_arm_is_refused_when_the_displacement_is_impossible(rig_without_zero):
    rig = rig_without_zero(6.0)
    arm = rig.at(1.0, "arm")
    rig.run(until_s=3.0)
    assert "mm possible at 2" in rig.status["fault"]
    assert rig.answers[arm] == rig.status["fault"]
    assert "armed, holding" not in [event for _, event in rig.status["events"]]
    assert currents(rig.ticks).max() < NONE_A


def test_warm_wire_is_held_at_its_displacement(rig):
    rig.at(1.0, "arm")
    rig.at(2.0, "track", reference="sine")
    rig.do(20.0, rig.page.request_off)
    rig.at(20.3, "arm")
    rig.run(until_s=24.0)
    held = rig.between(21.0, 24.0)
    assert held[0].command.setpoint_mm > 1.0
    assert np.abs(error_mm(held)).max() < 0.03 * 12.0


def stop_builder(rig, *, from_s, to_s):
    """Stop the builder for a while."""
    rig.do(from_s, lambda: setattr(rig.builder, "is_stopped", True))
    rig.do(to_s, lambda: setattr(rig.builder, "is_stopped", False))


@pytest.mark.exhaustive
def test_arm_that_waits_too_long_is_refused_and_does_not_heat_later(rig):
    rig.at(0.5, "arm")
    rig.at(1.0, "track", reference="sine")
    rig.do(19.0, rig.page.request_off)
    stop_builder(rig, from_s=19.4, to_s=35.0)
    change = rig.at(19.5, "shape", key="mu_heating", value=90.2)
    arm = rig.at(19.6, "arm")
    rig.run(until_s=40.0)
    assert "still being built: press Arm again" in rig.answers[arm]
    assert rig.answers[change] is None
    assert rig.status["mode"] == "off"
    assert currents(rig.between(19.2, 40.0)).max() < NONE_A


def test_arm_waits_for_a_change_and_begins_with_it(rig):
    stop_builder(rig, from_s=0.9, to_s=2.0)
    rig.at(1.0, "shape", key="mu_heating", value=90.2)
    arm = rig.at(1.1, "arm")
    held = []
    rig.do(1.9, lambda: held.append(rig.status["mode"]))
    rig.run(until_s=3.0)
    assert held == ["off"]
    assert rig.answers[arm] is None
    assert rig.status["mode"] == "holding"
    assert rig.status["tuning"]["shape"]["mu_heating"] == pytest.approx(90.2)


def test_malformed_request_is_reported_and_ignored(rig):
    rig.do(1.0, lambda: rig.page.messages.send(b"\xff no json"))
    rig.at(1.1, "explode")
    rig.at(1.2, "shape", key="mu_heating", value="nan")
    rig.at(1.3, "shape", key="mu_heating", value=90.0, extra=1)
    rig.run(until_s=2.0)
    assert set(rig.answers) == {1, 2, 3}
    assert len([event for _, event in rig.status["events"] if event.startswith("refused")]) == 4
    assert rig.status["tuning"]["change"] == "as identified"


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_nonfinite_value_is_refused(rig, value):
    asked = rig.at(1.0, "shape", key="mu_heating", value=value)
    rig.run(until_s=2.0)
    assert "finite number" in rig.answers[asked]


def test_long_texts_do_not_end_the_session(rig):
    for n in range(8):
        rig.at(1.0 + 0.2 * n, "track", reference="x" * 60000)
    rig.run(until_s=5.0)
    assert len(rig.status["events"]) == 8


def test_arm_is_refused_when_the_temperature_is_unknown(rig):
    rig.do(0.5, rig.device.bench.sensors.faults.open_thermocouple)
    arm = rig.at(1.0, "arm")
    rig.run(until_s=2.0)
    assert rig.answers[arm].startswith("refused to arm: ")
    assert "no valid reading (thermocouple_open)" in rig.answers[arm]


def test_trip_is_published_and_ends_at_zero_current(rig):
    rig.at(1.0, "arm")
    rig.at(2.0, "track", reference="sine")
    rig.do(20.0, rig.device.bench.sensors.faults.open_thermocouple)
    rig.run(until_s=22.0)
    assert "fault" in rig.status["fault"]
    assert rig.status["mode"] == "off"
    assert currents(rig.between(21.0, 22.0)).max() < NONE_A


def test_trip_is_published_as_latched_until_it_is_cleared(rig):
    latched = []
    rig.at(1.0, "arm")
    rig.at(2.0, "track", reference="sine")
    rig.do(6.0, lambda: latched.append(rig.status["latched"]))
    rig.do(6.0, lambda: rig.device.bench.sensors.faults.open_thermocouple(1.0))
    rig.do(8.0, lambda: latched.append(rig.status["latched"]))
    rig.at(9.0, "clear")
    rig.run(until_s=11.0)
    before, tripped = latched
    assert before is None
    assert "thermocouple_open" in tripped
    assert rig.status["latched"] is None
