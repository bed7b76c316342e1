"""The source of the displacement: chosen in the rig file or on the page, kept by changes, replaced, and refused."""

from math import isnan, nan

import numpy as np
import pytest
from marks import exhaustive

from firmware_sim.bench import SimulatedBench
from firmware_sim.config import load_sim
from smadrive.clock import VirtualClock
from smadrive.control.controllers.source_events import BY_RESISTANCE, BY_SENSOR
from smadrive.devices.profile.profile import load_profile
from smadrive.errors import ConfigError
from smadrive.measurement import DisplacementFrom
from smadrive.rig.config import load_rig
from smadrive.runs.log.reader import read_log
from smadrive.runs.metrics.tracking_error import measured_mm
from smadrive.runs.run_log import record_session
from smadrive.runs.session_record import models_of, tunings_of
from smadrive.stream.samples import COLUMNS
from smadrive.tuning.session.adaptation_runner import NEEDS_SENSOR, SENSOR_FAILED, AdaptationRunner
from smadrive.wire.identified_resistance import WireResistance
from smadrive.wire.identified_wire import parse_wire
from smadrive.wire.wire_properties import WireProperties
from tests.unit.tuning.conftest import BALANCE

RESISTANCE = WireResistance(22.0, 16.5, 0.0, 0.0, 0.004, 0.001, 0.01, (20.0, 80.0, 140.0), (14.52,) * 3)
STROKE_MM = 12.0
MOST_W = 0.1
"""Largest change of the power between two ticks while the wire follows the sine."""


def with_resistance(rig, **changes):
    """Give the rig an identified resistance, and `changes` of its rig file."""
    rig.properties = WireProperties(BALANCE, RESISTANCE)
    config = load_rig("in-process").model_copy(update=changes)
    rig._config = lambda: config
    return rig


@pytest.fixture
def resistive_rig(rig):
    return with_resistance(rig)


@pytest.fixture
def adapting_rig(ruled_rig):
    return with_resistance(ruled_rig)


def choose(rig, time_s, source):
    return rig.at(time_s, "source", displacement_from=source)


def tracked(rig, at_s=2.0):
    rig.at(1.0, "arm")
    rig.at(at_s, "track", reference="sine")
    return rig


def events(rig):
    return [text for _, text in rig.status["events"]]


def true_rms_percent(rig, from_s, to_s):
    """Return the RMS of setpoint - displacement of the plant, in % of the stroke."""
    errors = [
        tick.command.setpoint_mm - true_mm
        for tick, (time_s, _, true_mm) in zip(rig.ticks, rig.wire, strict=True)
        if from_s <= time_s < to_s
    ]
    return 100.0 * float(np.sqrt(np.mean(np.square(errors)))) / STROKE_MM


def steps_w(rig, around_s):
    """Return the changes of the commanded power from tick to tick, from half a second before a time until after it."""
    return np.abs(np.diff([tick.command.power_w for tick in rig.between(around_s - 0.5, around_s + 0.5)]))


@pytest.mark.exhaustive
def test_rig_file_by_resistance_measures_changed_leads_even_after_a_long_hold(rig):
    """While a cold wire is held, no current measures its leads. 0.1 Ω that is not measured costs 5 % of the stroke."""
    with_resistance(rig, displacement_from=DisplacementFrom.RESISTANCE)
    rig.device.bench.plant.faults.corrode_contact(0.1)
    rig.device.bench.sensors.faults.slip_displacement(0.5)
    tracked(rig, at_s=6.0).run(until_s=32.0)
    assert true_rms_percent(rig, 18.0, 32.0) < 0.8
    assert rig.status["displacement_in_force"] == rig.status["tuning"]["displacement_from"] == "resistance"
    assert all(tick.command.uses_resistance for tick in rig.between(18.0, 32.0))


@pytest.mark.parametrize("source", ["resistance", exhaustive("none")])
def test_chosen_source_is_put_in_force_without_a_jump(resistive_rig, source):
    rig = tracked(resistive_rig)
    there, back = choose(rig, 15.0, source), choose(rig, 19.0, "sensor")
    seen = []
    rig.do(18.0, lambda: seen.append(rig.status["displacement_in_force"]))
    rig.run(until_s=22.0)
    assert rig.answers[there] is None
    assert rig.answers[back] is None
    assert seen == [source]
    assert rig.status["displacement_in_force"] == "sensor"
    for at_s in (15.0, 19.0):
        assert steps_w(rig, at_s).max() < MOST_W
    assert true_rms_percent(rig, 15.0, 22.0) < 0.8


@pytest.mark.exhaustive
def test_many_changes_between_all_sources_keep_the_wire_on_its_reference(resistive_rig):
    rig = tracked(resistive_rig)
    for number, source in enumerate(("resistance", "none", "sensor") * 6):
        choose(rig, 15.0 + 10.0 * number, source)
    rig.run(until_s=200.0)
    assert true_rms_percent(rig, 15.0, 200.0) < 1.0
    assert max(steps_w(rig, 15.0 + 10.0 * number).max() for number in range(18)) < 2.0 * MOST_W


def test_resistance_checks_the_thermocouple_from_the_change_to_it(rig):
    """The bead comes off. Without the check, the wire gets hotter than its limit before the thermocouple shows it."""
    devices = [device.model_copy(update={"measures": ["temperature"]}) for device in load_rig("in-process").devices]
    with_resistance(rig, displacement_from=DisplacementFrom.NONE, devices=devices)
    tracked(rig)
    choose(rig, 10.0, "resistance")
    rig.do(14.0, lambda: rig.device.bench.sensors.bead.loosen_bead(contact=0.05, over_s=0.5))
    rig.run(until_s=24.0)
    assert rig.status["fault"].startswith("fault 21")
    assert max(wire_c for _, wire_c, _ in rig.wire) < load_rig("in-process").limits.temperature_max_c


def test_resistance_that_the_board_does_not_measure_is_not_used(rig):
    """A TCLab computes its voltage, so its resistance is that of a cold wire at every temperature."""
    rig.device, rig.clock = SimulatedBench(load_sim("flexinol-lt-0.15mm")).attach(load_profile("tclab")), VirtualClock()
    rig.clock.follow(rig.device.bench.advance_to)
    config = load_rig("tclab")
    with_resistance(rig)._config = lambda: config
    tracked(rig, at_s=6.0)
    refused = choose(rig, 8.0, "resistance")
    rig.run(until_s=12.0)
    assert "does not measure" in rig.answers[refused]
    assert sum("resistance in the model file" in text for text in events(rig)) == 1
    assert all(isnan(tick.command.by_resistance_mm) for tick in rig.ticks)
    assert rig.ticks[-1].command.power_w > 0.1


def test_arm_warns_of_a_warm_wire_whose_displacement_is_unknown(rig):
    with_resistance(rig, displacement_from=DisplacementFrom.NONE)
    tracked(rig)
    rig.do(20.0, rig.page.request_off)
    rig.at(21.0, "arm")
    counts = []
    for time_s in (19.5, 21.9):
        rig.do(time_s, lambda: counts.append(sum(event.startswith("warning: ") for event in events(rig))))
    rig.run(until_s=22.0)
    assert counts[1] == counts[0] + 1


@pytest.mark.exhaustive
def test_every_change_keeps_the_source_and_undo_takes_its_choice_back(resistive_rig):
    rig = tracked(resistive_rig)
    choose(rig, 13.0, "resistance")
    rig.at(14.0, "shape", key="mu_heating", value=90.0)
    rig.at(15.0, "feedback", key="closed_loop_s", value=0.3)
    for time_s in (16.0, 16.5, 17.0):
        rig.at(time_s, "undo")
    rig.run(until_s=18.0)
    assert all(tick.command.uses_resistance for tick in rig.between(13.5, 17.0))
    assert not any(tick.command.uses_resistance for tick in rig.between(17.3, 18.0))
    assert (rig.status["undo"], rig.status["redo"]) == (None, "displacement_from")


def test_slots_keep_their_sources_and_may_differ_by_them_alone(resistive_rig):
    rig = resistive_rig
    rig.at(0.5, "keep", slot="A")
    choose(rig, 0.6, "resistance")
    rig.at(1.0, "keep", slot="B")
    rig.at(1.2, "recall", slot="A")
    slots = []
    rig.do(1.5, lambda: slots.append(rig.session.tunings.comparison.slots))
    rig.run(until_s=1.7)
    assert rig.status["tuning"]["displacement_from"] == "sensor"
    assert slots[0]["B"].displacement_from is DisplacementFrom.RESISTANCE
    assert not slots[0]["A"].drives_as(slots[0]["B"])


def test_source_without_an_identified_resistance_is_refused_and_changes_nothing(rig):
    asked = choose(rig, 0.5, "resistance")
    rig.run(until_s=1.0)
    assert "the model file has no resistance" in rig.answers[asked]
    assert rig.status["tuning"]["displacement_from"] == "sensor"
    assert rig.status["undo"] is None


def test_sensor_that_the_rig_lacks_is_refused_and_changes_nothing(rig):
    devices = [device.model_copy(update={"measures": ["temperature"]}) for device in load_rig("in-process").devices]
    with_resistance(rig, displacement_from=DisplacementFrom.NONE, devices=devices)
    asked = choose(rig, 0.5, "sensor")
    rig.run(until_s=1.0)
    assert "no device of the rig measures the displacement" in rig.answers[asked]
    assert rig.status["tuning"]["displacement_from"] == "none"


def test_unknown_source_is_refused(resistive_rig):
    rig = resistive_rig
    unknown = choose(rig, 0.5, "laser")
    rig.run(until_s=1.0)
    assert "displacement_from" in rig.answers[unknown]


def test_resistance_replaces_a_sensor_that_shows_nothing_until_it_works_again(resistive_rig):
    rig = tracked(resistive_rig)
    displacement = rig.device.bench.sensors.faults.displacement
    rig.do(14.0, lambda: displacement.begin("open", None, lambda _reading, _age_s: nan))
    seen = []
    rig.do(16.0, lambda: seen.append(rig.status))
    rig.do(16.0, displacement.end)
    rig.run(until_s=19.0)
    assert seen[0]["displacement_in_force"] == "resistance"
    assert seen[0]["tuning"]["displacement_from"] == "sensor"
    assert rig.status["displacement_in_force"] == "sensor"
    assert events(rig).index(BY_RESISTANCE) < events(rig).index(BY_SENSOR)
    assert true_rms_percent(rig, 13.0, 19.0) < 0.8


@pytest.mark.parametrize("ends", [lambda rig: rig.at(16.0, "off"), lambda rig: choose(rig, 16.0, "none")])
def test_sensor_that_is_not_used_any_more_is_not_said_to_be_valid_again(resistive_rig, ends):
    rig = tracked(resistive_rig)
    displacement = rig.device.bench.sensors.faults.displacement
    rig.do(14.0, lambda: displacement.begin("open", None, lambda _reading, _age_s: nan))
    ends(rig)
    rig.run(until_s=18.0)
    assert BY_RESISTANCE in events(rig)
    assert BY_SENSOR not in events(rig)


def test_slipped_sensor_is_not_fitted_and_not_scored(resistive_rig, tmp_path):
    rig = tracked(resistive_rig)
    path = tmp_path / "tuning.h5"
    rig.recording = lambda opened: record_session(path, opened, rig.properties.identified(rig.model))
    rig.do(14.0, lambda: rig.device.bench.sensors.faults.slip_displacement(2.5))
    rig.run(until_s=17.0)
    assert BY_RESISTANCE in events(rig)
    _, rows = rig.page.since(0)
    at_s, shown_mm = (rows[:, COLUMNS.index(name)] for name in ("time_s", "displacement_mm"))
    assert np.isnan(shown_mm[at_s > 16.0]).all()
    log = read_log(path)
    assert np.isnan(measured_mm(log)[log.column("time_s") > 16.0]).all()
    assert np.isfinite(measured_mm(log)[log.column("time_s") < 13.9]).all()
    assert sum(event.message == BY_RESISTANCE for event in log.events) == 1


def test_warm_wire_is_armed_by_resistance_with_a_warning(resistive_rig):
    rig = tracked(resistive_rig)
    rig.do(8.0, rig.page.request_off)
    choose(rig, 8.2, "resistance")
    rig.at(8.6, "arm")
    rig.run(until_s=9.5)
    assert rig.status["mode"] == "holding"
    assert any("change of leads and contacts cannot be measured" in text for text in events(rig))


def test_adaptation_needs_the_sensor_and_ends_with_another_source(adapting_rig):
    rig = tracked(adapting_rig)
    rig.at(3.0, "adapt", on=True)
    choose(rig, 5.0, "resistance")
    refused = rig.at(6.0, "adapt", on=True)
    rig.run(until_s=7.0)
    assert not rig.status["adapts"]
    assert f"adaptation ended: {NEEDS_SENSOR}" in events(rig)
    assert NEEDS_SENSOR in rig.answers[refused]


def test_adaptation_without_the_sensor_is_refused(adapting_rig):
    tuning = with_resistance(adapting_rig, displacement_from=DisplacementFrom.NONE).tuning(adapting_rig._config())
    with pytest.raises(ConfigError) as refused:
        AdaptationRunner(tuning, BALANCE, 0.05, 0.1).switch(True, tuning)
    assert (refused.value.where, refused.value.value) == ("displacement_from", "none")


def test_adaptation_of_the_rig_file_does_not_keep_a_wire_without_sensor_from_being_armed(adapting_rig):
    feedback = load_rig("in-process").feedback.model_copy(update={"adapt": True})
    rig = with_resistance(adapting_rig, displacement_from=DisplacementFrom.NONE, feedback=feedback)
    rig.at(1.0, "arm")
    rig.run(until_s=2.0)
    assert rig.status["mode"] == "holding"
    assert f"not adapted: {NEEDS_SENSOR}" in events(rig)


@pytest.mark.exhaustive
def test_sensor_that_slips_ends_the_adaptation_with_the_rules_from_before(adapting_rig):
    rig = tracked(adapting_rig)
    rig.at(3.0, "adapt", on=True)
    rig.do(16.0, lambda: rig.device.bench.sensors.faults.slip_displacement(0.7))
    rig.run(until_s=20.0)
    assert BY_RESISTANCE in events(rig)
    assert any(SENSOR_FAILED in text for text in events(rig)), events(rig)
    assert not rig.status["adapts"]
    assert true_rms_percent(rig, 18.0, 20.0) < 1.0


@pytest.mark.exhaustive
def test_log_holds_the_source_and_the_resistance_of_each_model(resistive_rig, tmp_path):
    rig = resistive_rig
    path = tmp_path / "tuning.h5"
    rig.recording = lambda opened: record_session(path, opened, rig.properties.identified(rig.model))
    choose(rig, 0.5, "resistance")
    rig.run(until_s=1.0)
    log = read_log(path)
    assert ["displacement_from = resistance" in put.values for put in tunings_of(log)] == [False, True]
    assert parse_wire(models_of(log)[1], place="log").resistance == RESISTANCE
    assert parse_wire(rig.status["tuning"]["wire"], place="status").resistance == RESISTANCE
