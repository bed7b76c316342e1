"""The drift of a wire since its identification, and the verdict."""

from math import hypot, isnan

import numpy as np
import pytest

from smadrive.hysteresis import DuhemModel
from smadrive.wire.health.drift import DRIFTED, HealthVerdict, slope, wire_health
from smadrive.wire.health.entry import IDENTIFICATION, Estimate, HealthEntry, LoopShape
from smadrive.wire.health.sensitivity import LoopWidths, error_gains

IDENTIFIED = HealthEntry(
    kind=IDENTIFICATION,
    begun="2026-03-01",
    model="a",
    rest_ohm=Estimate(10.0, 0.05),
    heating_c=Estimate(90.0),
    cooling_c=Estimate(70.0),
    stroke_mm=Estimate(12.0),
)
GAINS = (1.0, 4.0, 4.0, 5.0)
ALLOWED = 1.0


def run(**changes):
    """A run of ten cycles that has measured these values, and otherwise the identified ones."""
    values = {
        "rest_ohm": Estimate(10.0, 0.05),
        "heating_c": Estimate(90.0, 0.1),
        "cooling_c": Estimate(70.0, 0.1),
        "stroke_mm": Estimate(12.0, 0.1),
    }
    return HealthEntry(kind="tracking", begun="", model="a", cycles=10.0, **values | changes)


def health(*runs):
    return wire_health([IDENTIFIED, *runs], GAINS, ALLOWED)


def test_no_identification_no_health():
    assert wire_health([run(), run()], GAINS, ALLOWED) is None


def test_one_run_is_not_enough():
    assert health(run(heating_c=Estimate(95.0, 0.1))).verdict is HealthVerdict.UNKNOWN


def test_resistance_that_rests_on_an_estimate_shows_no_drift():
    values = {name: Estimate() for name in ("rest_ohm", "heating_c", "cooling_c", "stroke_mm")}
    found = health(*[run(**values, estimated_rest_ohm=Estimate(15.0, 0.05))] * 3)
    assert (found.verdict, found.drifts) == (HealthVerdict.UNKNOWN, {})


def test_wire_is_not_called_unchanged_before_its_loop_is_measured():
    values = {name: Estimate() for name in ("heating_c", "cooling_c", "stroke_mm")}
    assert health(*[run(**values)] * 3).verdict is HealthVerdict.UNKNOWN
    assert health(*[run()] * 3).verdict is HealthVerdict.UNCHANGED


def test_slope_is_no_more_certain_than_its_values():
    on_a_line = slope([1.0, 2.0, 3.0], [Estimate(value, 0.1) for value in (1.0, 1.1, 1.2)])
    assert on_a_line.error == pytest.approx(0.1 / np.sqrt(2.0))


def test_scatter_within_the_errors_is_no_drift():
    found = health(run(heating_c=Estimate(90.2, 0.1)), run(heating_c=Estimate(90.25, 0.1)))
    assert (found.verdict, found.error_percent) == (HealthVerdict.UNCHANGED, 0.0)


def test_single_strange_run_is_no_drift():
    strange = run(heating_c=Estimate(95.0, 0.1))
    assert not health(run(), strange).drifts["heating_c"].counts
    assert health(run(), strange, run()).verdict is HealthVerdict.UNCHANGED


def test_last_run_that_differs_is_not_called_unchanged():
    found = health(run(), run(heating_c=Estimate(95.0, 0.1)))
    assert found.verdict is HealthVerdict.DIFFERS
    assert [name for name, drift in found.drifts.items() if drift.is_significant] == ["heating_c"]


@pytest.mark.parametrize(("before", "ohm"), [(0, 2.5), (3, 2.5), (3, 9.0)])
def test_single_run_shows_a_jump_of_the_resistance(before, ohm):
    """The first cases are another wire, the last is a cracked crimp: a small jump that the calm runs make visible."""
    calm, jumped = run(rest_spread=0.005), run(rest_ohm=Estimate(ohm, 0.01), rest_spread=0.005, tripped=True)
    found = health(*[calm] * before, jumped)
    assert found.verdict is HealthVerdict.JUMPED
    assert found.verdict in DRIFTED
    assert health(*[calm] * before, jumped, jumped).verdict is HealthVerdict.JUMPED
    assert health(*[calm] * 3, jumped, calm).verdict is HealthVerdict.UNCHANGED


def test_drifts_in_opposite_directions_are_none():
    found = health(run(heating_c=Estimate(91.0, 0.1)), run(heating_c=Estimate(89.0, 0.1)))
    assert not found.drifts["heating_c"].counts
    assert found.error_percent == 0.0


def test_small_drift_says_when_to_identify_again():
    moved = run(stroke_mm=Estimate(11.9, 0.01))
    found = health(moved, moved)
    assert found.verdict is HealthVerdict.DRIFTED
    assert found.error_percent == pytest.approx(0.5)
    assert found.cycles_left == pytest.approx(20.0)


def test_costly_drift_asks_for_an_identification():
    moved = run(heating_c=Estimate(90.5, 0.1), cooling_c=Estimate(70.5, 0.1))
    found = health(moved, moved)
    assert found.verdict is HealthVerdict.IDENTIFY_AGAIN
    assert found.error_percent == pytest.approx(hypot(2.0, 2.0))
    assert isnan(found.cycles_left)


def test_identification_begins_anew_and_keeps_the_first_one():
    moved = run(heating_c=Estimate(92.0, 0.1))
    again = IDENTIFIED.model_copy(update={"model": "b", "heating_c": Estimate(92.0)})
    adapted = run(heating_c=Estimate(92.0, 0.1), adapted=LoopShape(93.0, 70.0, 12.6))
    found = wire_health([IDENTIFIED, moved, moved, again, adapted, moved], GAINS, ALLOWED)
    assert found.verdict is HealthVerdict.UNCHANGED
    assert (found.runs, found.cycles, found.all_cycles) == (2, 20.0, 40.0)
    assert found.model_moved == (2.0, 0.0, 0.0)
    assert found.adapted_moved == pytest.approx((3.0, 0.0, 5.0))


def test_run_without_a_sensor_leaves_the_loop_unknown():
    blind = {name: Estimate() for name in ("heating_c", "cooling_c", "stroke_mm")}
    found = health(run(**blind), run(**blind))
    assert list(found.drifts) == ["rest_ohm"]
    assert found.verdict is HealthVerdict.UNKNOWN


def test_slope_of_noisy_values_has_an_honest_error():
    random = np.random.default_rng(1)
    cycles = np.arange(40.0)
    off = []
    for _ in range(200):
        found = slope(cycles, [Estimate(v, 0.1) for v in 1.0 + 0.01 * cycles + 0.1 * random.standard_normal(40)])
        off.append((found.value - 0.01) / found.error)
    assert np.std(off) == pytest.approx(1.0, abs=0.2)


def test_slope_of_two_values_is_unknown():
    assert not slope([1.0, 2.0], [Estimate(1.0, 0.1), Estimate(2.0, 0.1)]).is_known


@pytest.mark.parametrize("sigma", [3.0, 6.0])
def test_sensitivity_is_the_error_of_a_moved_model(sigma):
    """A reference that is uniform over the stroke, on the heating branch of a wire that has moved by 0.2 K."""
    model, moved = (
        DuhemModel.gaussian(
            mu_heating=90 + k, mu_cooling=70, sigma_heating=sigma, sigma_cooling=sigma, scale=10, input_range=(20, 160)
        )
        for k in (0.0, 0.2)
    )
    v = np.linspace(50.0, 130.0, 4000)
    y, moved_y = model.simulate(v), moved.simulate(v)
    rms = 10.0 * np.sqrt(np.sum((moved_y - y)[1:] ** 2 * np.diff(y)) / (y[-1] - y[0]))
    widths = LoopWidths(sigma, sigma, 58.0)
    found = error_gains(widths, loop_share=0.1, noise_c=0.1, fit_percent=0.3)
    assert 0.2 * found.heating_per_k * np.sqrt(2.0) == pytest.approx(rms, rel=0.03)
    assert found.allowed_percent == pytest.approx(hypot(0.3, 0.1 * hypot(found.heating_per_k, found.cooling_per_k)))
