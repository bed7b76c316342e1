"""What the adaptation puts in force on a healthy wire, and what is left when it ends."""

import numpy as np
import pytest
from marks import exhaustive

from smadrive.control.controllers.temperature import Command
from smadrive.control.loop import Tick
from smadrive.hysteresis import TSFuzzyDuhem
from smadrive.hysteresis.fuzzy import TriangularSets
from smadrive.measurement import Measurement
from smadrive.rig.config import FeedbackConfig
from smadrive.tuning.session.adaptation_runner import AdaptationRunner
from smadrive.tuning.tuning import Tuning
from tests.unit.tuning.conftest import BALANCE

FOUND_S = 75.9
"""When that adaptation ends."""


@pytest.fixture
def lied_to(ruled_bench):
    """A session that tracks and whose adaptation finds at FOUND_S that it was lied to."""
    faults = ruled_bench.device.bench.sensors.faults
    ruled_bench.at(1.0, "arm")
    ruled_bench.at(1.2, "adapt", on=True)
    ruled_bench.at(1.5, "track", reference="sine")
    ruled_bench.do(50.0, lambda: faults.thermocouple.begin("drift", None, lambda r, age_s: r.right + 0.05 * age_s))
    ruled_bench.do(75.0, lambda: faults.displacement.begin("stuck", None, lambda r, age_s: r.shown))
    return ruled_bench


@pytest.mark.parametrize("off_after_s", [None, exhaustive(0.05), 0.1, exhaustive(0.15)])
def test_when_its_sensor_is_found_lying_the_rules_of_well_before_are_put_in_force(lied_to, off_after_s):
    """A thermocouple that drifts is followed for a while: what was learnt by then must not stay, whenever OFF comes."""
    spoilt = []
    if off_after_s is not None:
        lied_to.do(FOUND_S + off_after_s, lied_to.page.request_off)
    lied_to.do(75.0, lambda: spoilt.append(lied_to.session.bench.in_force.model))
    lied_to.run(until_s=90.0)
    (ended_s, told) = next(entry for entry in lied_to.status["events"] if "adaptation ended" in entry[1])
    assert ended_s == pytest.approx(FOUND_S, abs=0.06)
    assert "its rules of well before are put in force" in told
    in_force = lied_to.session.bench.in_force
    assert in_force.change == "adaptation"
    assert in_force.model.scale != pytest.approx(spoilt[0].scale, rel=1e-3), "what was learnt by the lie is in force"
    assert not lied_to.status["adapts"]


@pytest.mark.parametrize(
    ("act", "values"), [exhaustive("adapt", {"on": True}), exhaustive("adapt", {"on": False}), ("undo", {})]
)
def test_rules_that_wait_to_be_taken_back_are_not_forgotten(lied_to, act, values):
    """A slider that is moved at that moment keeps them waiting."""
    lied_to.at(FOUND_S, "feedback", key="closed_loop_s", value=0.3)
    asked = lied_to.at(FOUND_S + 0.05, act, **values)
    lied_to.run(until_s=80.0)
    assert "rules of well before wait for their turn" in lied_to.answers[asked]
    assert lied_to.session.bench.in_force.change == "adaptation"


def test_what_is_compared_is_not_adapted(ruled_bench):
    ruled_bench.at(1.1, "keep", slot="A")
    ruled_bench.at(1.2, "feedback", key="closed_loop_s", value=0.3)
    ruled_bench.at(1.5, "keep", slot="B")
    ruled_bench.at(2.0, "arm")
    ruled_bench.at(3.0, "track", reference="sine")
    ruled_bench.at(4.0, "adapt", on=True)
    too_early = ruled_bench.at(5.0, "compare", on=True)
    ruled_bench.at(6.0, "adapt", on=False)
    compare = ruled_bench.at(7.0, "compare", on=True)
    too_late = ruled_bench.at(8.0, "adapt", on=True)
    ruled_bench.run(until_s=9.0)
    assert "would change what is compared" in ruled_bench.answers[too_early]
    assert ruled_bench.answers[compare] is None
    assert "stop the comparison first" in ruled_bench.answers[too_late]


@pytest.mark.parametrize("at_s", [2.5, 3.0, 3.5])
def test_switched_on_while_a_healthy_wire_heats_up_it_leaves_the_rules(bench, at_s):
    """The wire rises by 50 K within a second then, and its thermocouple shows it later."""
    sets = TriangularSets(tuple(np.linspace(50.0, 110.0, 31).tolist()))
    bench.model = TSFuzzyDuhem.from_duhem(bench.model, sets)
    bench.at(1.0, "arm")
    bench.at(2.0, "track", reference="sine")
    bench.at(at_s, "adapt", on=True)
    bench.run(until_s=20.0)
    assert bench.status["adapts"], bench.status["events"]
    after = bench.session.bench.in_force
    assert after.change == "adaptation"
    before, adapted = (bench.rms_percent([(20.0, model)], over_s=20.0) for model in (bench.model, after.model))
    assert adapted < before + 0.2, (adapted, before)


def test_two_ticks_of_one_instant_are_no_error(ruled_bench):
    tuning = Tuning.of(ruled_bench.model, FeedbackConfig(), "as identified")
    adapting = AdaptationRunner(tuning, BALANCE, 0.05, 0.1)
    measured = Measurement(1.0, 22.0, 0.1, 1.65, displacement_mm=0.0)
    for _ in range(2):
        assert adapting.update(Tick(1.0, 0.0, measured, Command(0.1)), tuning, is_heating=True) is None
