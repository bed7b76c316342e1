"""The plan of a run with cycles: what the wire cannot follow is smoothed or refused before the heat."""

from dataclasses import replace

import pytest
from marks import exhaustive

from smadrive.control.controllers.step import ManualStep
from smadrive.control.references.holding import APPROACH_S
from smadrive.control.references.reference import Reference
from smadrive.control.references.shapes import parse_reference, sine
from smadrive.errors import ConfigError
from smadrive.hysteresis import DuhemModel
from smadrive.measurement import DisplacementFrom
from smadrive.rig.config import load_rig
from smadrive.rig.controllers import step_controller
from smadrive.rig.rig import Rig
from smadrive.runs.cycling.continuation import one_cycle
from smadrive.runs.cycling.cycles import CycleMetrics, Cycling
from smadrive.runs.tracking_plan import SMOOTHED_AGAIN, plan_tracking
from smadrive.wire.identified_resistance import WireResistance
from smadrive.wire.identified_wire import IdentifiedWire

WIRE = IdentifiedWire(
    DuhemModel.gaussian(
        mu_heating=89.9, mu_cooling=69, sigma_heating=5, sigma_cooling=5, scale=12, input_range=(20, 130)
    ),
    None,
)
STEPS = Reference.from_samples([0.0, 10.0, 10.1, 20.0, 20.1, 30.0], [2.0, 2.0, 8.0, 8.0, 2.0, 2.0])
TRIANGLE = parse_reference("triangle:low_mm=2,high_mm=10,period_s=7")

SLOW = sine(low_mm=2.0, high_mm=6.0, period_s=60.0, cycles=1.0)
WARM = ManualStep(None, 78.0, 20.0)


def planned(reference, cycles=None):
    cycling = None if cycles is None else Cycling(cycles)
    with Rig(load_rig("in-process")) as rig:
        return plan_tracking(rig, reference, WIRE, smooth=True, smooth_option="--smooth", cycling=cycling)


@pytest.mark.exhaustive
def test_smoothed_reference_that_is_closed_is_repeated_without_a_way_back():
    plan = planned(STEPS, 4)
    assert plan.nearest is not plan.given
    assert (plan.nearest.repeats, plan.nearest.cycle_s) == (4, pytest.approx(STEPS.duration_s))


def test_cycles_that_the_wire_cannot_follow_even_smoothed_are_refused():
    with pytest.raises(ConfigError) as error:
        planned(sine(low_mm=1.0, high_mm=11.0, period_s=2.0, cycles=1.0), 4)
    assert error.value.where == "reference"


@pytest.mark.parametrize("smooth", [True, exhaustive(False)])
def test_continuation_tracks_the_cycles_that_the_previous_part_has_smoothed(smooth):
    one = one_cycle(planned(TRIANGLE, 4).nearest)
    part = Cycling(4, (CycleMetrics(1, *6 * (1.0,)),), "part.h5")
    with Rig(load_rig("in-process")) as rig:
        plan = plan_tracking(rig, one, WIRE, smooth=smooth, smooth_option="--smooth", cycling=part)
    assert plan.nearest is plan.given
    assert plan.nearest.repeats == 3


@pytest.mark.exhaustive
def test_cycles_that_are_smoothed_again_have_a_caveat():
    part = Cycling(4, (CycleMetrics(1, *6 * (1.0,)),), "part.h5")
    with Rig(load_rig("in-process")) as rig:
        plan = plan_tracking(rig, STEPS, WIRE, smooth=True, smooth_option="--smooth", cycling=part)
    assert SMOOTHED_AGAIN in plan.caveats
    assert plan.nearest is not plan.given


@pytest.mark.exhaustive
def test_reference_that_is_repeated_already_runs_with_all_its_cycles():
    swing = sine(low_mm=2.0, high_mm=6.0, period_s=12.0, cycles=1.0)
    plan = planned(swing.repeated(5, 10.0))
    assert plan.cycling == Cycling(5)
    assert plan.nearest.duration_s == pytest.approx(APPROACH_S + 5 * 12.0)
    assert planned(STEPS.repeated(3, 10.0)).nearest.repeats == 3
    with pytest.raises(ConfigError):
        planned(swing.repeated(5, 10.0), 2)


def test_reference_without_an_end_is_refused():
    with pytest.raises(ConfigError) as error:
        planned(STEPS.without_end(10.0))
    assert error.value.where == "reference"
    assert planned(STEPS.without_end(10.0), 2).nearest.repeats == 2


def test_run_from_a_warm_wire_without_a_measured_displacement_has_a_caveat():
    counts = []
    with Rig(load_rig("in-process")) as rig:
        for _ in range(2):
            options = {"smooth": True, "smooth_option": "--smooth", "displacement_from": DisplacementFrom.NONE}
            counts.append(len(plan_tracking(rig, SLOW, WIRE, **options).caveats))
            rig.drive(step_controller(rig.config, WARM, rig.nominal_balance), rig.nominal_balance, lambda _tick: None)
    assert counts[1] == counts[0] + 1


def test_resistance_that_the_rig_cannot_measure_is_left_out_with_a_caveat():
    resistance = WireResistance(22.0, 16.5, 0.0, 0.0, 0.004, 0.001, 0.01, (20.0, 80.0, 140.0), (14.52,) * 3)
    plans = []
    for wire in (WIRE, replace(WIRE, resistance=resistance)):
        with Rig(load_rig("tclab").at("sim://flexinol-lt-0.15mm")) as rig:
            plans.append(plan_tracking(rig, SLOW, wire, smooth=True, smooth_option="--smooth"))
    without, plan = plans
    assert plan.wire.resistance is None
    assert len(plan.caveats) == len(without.caveats) + 1
