"""The rules that the adaptation puts in force on a healthy wire, and those that remain when it ends."""

from math import nan

import numpy as np
import pytest
from marks import exhaustive

from smadrive.control.controllers.interface import Command
from smadrive.control.loop import Tick
from smadrive.hysteresis import TSFuzzyDuhem
from smadrive.hysteresis.fuzzy import TriangularSets
from smadrive.identification.reshape import reshaped, shape_of
from smadrive.measurement import Measurement
from smadrive.rig.config import FeedbackConfig
from smadrive.tuning.session.adaptation_runner import AdaptationRunner
from smadrive.tuning.tuning import Tuning
from tests.unit.tuning.conftest import BALANCE

FOUND_S = 75.7
"""The time at which the adaptation of `faulty_rig` finds the fault and ends."""


@pytest.fixture
def faulty_rig(ruled_rig):
    """A rig that tracks a reference. At `FOUND_S` its adaptation finds that a sensor is faulty."""
    faults = ruled_rig.device.bench.sensors.faults
    ruled_rig.at(1.0, "arm")
    ruled_rig.at(1.2, "adapt", on=True)
    ruled_rig.at(1.5, "track", reference="sine")
    ruled_rig.do(50.0, lambda: faults.thermocouple.begin("drift", None, lambda r, age_s: r.right + 0.05 * age_s))
    ruled_rig.do(75.0, lambda: faults.displacement.begin("stuck", None, lambda r, age_s: r.previous))
    return ruled_rig


@pytest.mark.parametrize("off_after_s", list(map(exhaustive, (None, 0.05, 0.1, 0.15))))
def test_rules_from_before_a_sensor_fault_are_put_in_force_again(faulty_rig, off_after_s):
    """The adaptation learns wrong rules from a drifting thermocouple. They must not stay, whenever OFF comes."""
    spoilt = []
    if off_after_s is not None:
        faulty_rig.do(FOUND_S + off_after_s, faulty_rig.page.request_off)
    faulty_rig.do(75.0, lambda: spoilt.append(faulty_rig.session.tunings.in_force.model))
    faulty_rig.run(until_s=90.0)
    (ended_s, event) = next(entry for entry in faulty_rig.status["events"] if "adaptation ended" in entry[1])
    assert ended_s == pytest.approx(FOUND_S, abs=0.06)
    assert "the rules from before the fault are put in force" in event
    in_force = faulty_rig.session.tunings.in_force
    assert in_force.change == "adaptation"
    assert in_force.model.scale != pytest.approx(spoilt[0].scale, rel=1e-3), (
        "the rules learnt from the fault are in force"
    )
    assert not faulty_rig.status["adapts"]


@pytest.mark.parametrize(
    ("act", "values"), [exhaustive("adapt", {"on": True}), exhaustive("adapt", {"on": False}), ("undo", {})]
)
@pytest.mark.exhaustive
def test_waiting_rules_of_an_ended_adaptation_are_put_in_force(faulty_rig, act, values):
    """A slider that is moved when the adaptation ends delays its rules."""
    faulty_rig.at(FOUND_S, "feedback", key="closed_loop_s", value=0.3)
    asked = faulty_rig.at(FOUND_S + 0.05, act, **values)
    faulty_rig.run(until_s=80.0)
    assert "rules from before the fault are not in force yet" in faulty_rig.answers[asked]
    assert faulty_rig.session.tunings.in_force.change == "adaptation"


def test_comparison_and_adaptation_exclude_each_other(ruled_rig):
    ruled_rig.at(1.1, "keep", slot="A")
    ruled_rig.at(1.2, "feedback", key="closed_loop_s", value=0.3)
    ruled_rig.at(1.5, "keep", slot="B")
    ruled_rig.at(2.0, "arm")
    ruled_rig.at(3.0, "track", reference="sine")
    ruled_rig.at(4.0, "adapt", on=True)
    too_early = ruled_rig.at(5.0, "compare", on=True)
    ruled_rig.at(6.0, "adapt", on=False)
    compare = ruled_rig.at(7.0, "compare", on=True)
    too_late = ruled_rig.at(8.0, "adapt", on=True)
    ruled_rig.run(until_s=9.0)
    assert "would change the compared tunings" in ruled_rig.answers[too_early]
    assert ruled_rig.answers[compare] is None
    assert "being compared" in ruled_rig.answers[too_late]


@pytest.mark.parametrize("at_s", [*map(exhaustive, (2.5, 3.5)), 3.0])
@pytest.mark.exhaustive
def test_adaptation_begun_while_a_healthy_wire_heats_up_leaves_the_rules(rig, at_s):
    """At this time the wire rises by 50 K within a second, and its thermocouple shows the rise later."""
    sets = TriangularSets(tuple(np.linspace(50.0, 110.0, 31).tolist()))
    rig.model = TSFuzzyDuhem.from_duhem(rig.model, sets)
    rig.at(1.0, "arm")
    rig.at(2.0, "track", reference="sine")
    rig.at(at_s, "adapt", on=True)
    rig.run(until_s=20.0)
    assert rig.status["adapts"], rig.status["events"]
    after = rig.session.tunings.in_force
    assert after.change == "adaptation"
    before, adapted = (rig.rms_percent([(20.0, model)], over_s=20.0) for model in (rig.model, after.model))
    assert adapted < before + 0.2, (adapted, before)


@pytest.mark.exhaustive
def test_sample_without_power_leaves_the_estimate_of_the_temperature(ruled_rig):
    """While the wire heats up, its thermocouple reads too low. An estimate that began there would be too cold."""
    ruled_rig.at(1.0, "arm")
    ruled_rig.at(2.0, "track", reference="sine")
    ruled_rig.run(until_s=14.0)
    short = reshaped(ruled_rig.model, shape_of(ruled_rig.model)._replace(scale=11.0))
    tuning = Tuning.of(short, FeedbackConfig(), "as identified")

    def learnt_mm(lost):
        runner = AdaptationRunner(tuning, BALANCE, 0.05, 0.1)
        runner.switch(True, tuning)
        for index, tick in enumerate(ruled_rig.ticks):
            measured = tick.measurement._replace(voltage_v=nan) if index == lost else tick.measurement
            runner.update(tick._replace(measurement=measured), tuning, is_heating=True)
        return runner.due(14.0, is_heating=True).model.scale - short.scale

    fastest = int(np.argmax(np.diff([tick.measurement.temperature_c for tick in ruled_rig.ticks])))
    assert learnt_mm(None) > 0.01
    assert learnt_mm(fastest) == pytest.approx(learnt_mm(None), rel=0.05)


def test_two_ticks_of_one_instant_are_accepted(ruled_rig):
    tuning = Tuning.of(ruled_rig.model, FeedbackConfig(), "as identified")
    adapting = AdaptationRunner(tuning, BALANCE, 0.05, 0.1)
    measured = Measurement(1.0, 22.0, 0.1, 1.65, displacement_mm=0.0)
    for _ in range(2):
        assert adapting.update(Tick(1.0, 0.0, measured, Command(0.1)), tuning, is_heating=True) is None
