"""References: shapes, the approach, and rejected lines and samples."""

import math
from inspect import signature

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from smadrive.control.references.limits import check_rig_limits
from smadrive.control.references.reference import Reference
from smadrive.control.references.shapes import SHAPES, parse_reference
from smadrive.errors import ConfigError, DataError


def test_sine_begins_low_and_swings_between_its_ends():
    reference = parse_reference("sine:low_mm=2,high_mm=9,period_s=56,cycles=2")
    assert reference.duration_s == pytest.approx(112.0)
    assert reference.value_mm(0.0) == pytest.approx(2.0)
    assert reference.value_mm(28.0) == pytest.approx(9.0, abs=1e-3)
    assert reference.displacement_mm.min() >= 2.0
    assert reference.displacement_mm.max() <= 9.0


def test_triangle_is_straight_and_staircase_dwells():
    triangle = parse_reference("triangle:low_mm=0,high_mm=4,period_s=8,cycles=1")
    assert triangle.value_mm(2.0) == pytest.approx(2.0)
    stairs = parse_reference("staircase:low_mm=0,high_mm=4,steps=4,dwell_s=10,rise_s=2")
    assert stairs.value_mm(17.0) == stairs.value_mm(21.9) == pytest.approx(1.0)
    assert max(stairs.displacement_mm) == 4.0
    assert stairs.displacement_mm[-1] == 0.0


def test_steps_jump_and_trapezoid_has_ramps():
    jumps = parse_reference("steps:low_mm=1,high_mm=4,dwell_s=10,cycles=1")
    assert [jumps.value_mm(t) for t in (5.0, 9.97, 10.01, 19.9, 20.1)] == pytest.approx([1, 1, 4, 4, 1])
    ramps = parse_reference("trapezoid:low_mm=1,high_mm=4,rise_s=6,dwell_s=3,cycles=1")
    assert [ramps.value_mm(t) for t in (0.0, 3.0, 6.0, 9.0, 12.0, 15.0, 18.0)] == pytest.approx(
        [1, 1, 2.5, 4, 4, 2.5, 1]
    )


@pytest.mark.parametrize(("cycles", "end_mm"), [(0.3, 3.4), (0.5, 5.0), (1.7, 3.4), (2.0, 1.0)])
def test_triangle_ends_with_its_last_cycle(cycles, end_mm):
    reference = parse_reference(f"triangle:low_mm=1,high_mm=5,period_s=10,cycles={cycles}")
    assert reference.duration_s == pytest.approx(10.0 * cycles)
    assert reference.displacement_mm[-1] == pytest.approx(end_mm)
    assert reference.displacement_mm.max() == pytest.approx(min(5.0, 1.0 + 8.0 * cycles))


@pytest.mark.parametrize(
    ("spec", "key", "value", "cure"),
    [
        ("steps:cycles=0.2", "cycles", 0.2, "choose 0.5"),
        ("steps:cycles=1.7", "cycles", 1.7, "choose 1.5 or 2"),
        ("trapezoid:cycles=0.7", "cycles", 0.7, "choose 0.5 or 1"),
        ("staircase:steps=0.5", "steps", 0.5, "choose 1"),
        ("staircase:steps=4.5", "steps", 4.5, "choose 4 or 5"),
    ],
)
def test_part_of_a_level_is_rejected_with_the_nearest_values(spec, key, value, cure):
    with pytest.raises(ConfigError) as error:
        parse_reference(f"{spec},low_mm=1,high_mm=5")
    assert (error.value.where, error.value.value, error.value.cure) == (f"reference: {key}", value, cure)


def test_chirp_becomes_faster():
    reference = parse_reference("chirp:low_mm=2,high_mm=8,start_hz=0.02,end_hz=0.1,duration_s=100")
    assert reference.displacement_mm.min() == pytest.approx(2.0, abs=1e-3)
    assert reference.displacement_mm.max() == pytest.approx(8.0, abs=1e-3)
    turns, time_s, direction = [], 0.0, 1
    while (time_s := reference.next_reversal_s(time_s, direction)) < 100.0:
        turns.append(time_s)
        direction = -direction
    assert len(turns) == 11  # 6 periods: the frequency is 0.06 Hz in the mean
    assert np.all(np.diff(turns, 2) < 0)


@pytest.mark.parametrize("approach_s", [5000.0, 1e9])
def test_table_of_a_long_approach_is_short_and_exact(approach_s):
    path = Reference.from_samples([0.0, 1.0], [7.0, 7.0]).with_approach(3.0, approach_s)
    assert path.times_s.size < 6000
    s = np.linspace(0.0, 1.0, 10_001)
    exact_mm = 3.0 + 4.0 * s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    np.testing.assert_allclose(np.interp(s * approach_s, path.times_s, path.displacement_mm), exact_mm, atol=4e-7)


def test_approach_is_smooth_and_not_scored():
    reference = parse_reference("sine:low_mm=2,high_mm=9,period_s=20,cycles=1").with_approach(0.5, 10.0)
    assert reference.value_mm(0.0) == pytest.approx(0.5)
    assert reference.value_mm(10.0) == pytest.approx(2.0)
    assert reference.scored_from_s == 10.0
    times = np.linspace(0, 10, 500)
    assert np.all(np.diff([reference.value_mm(t) for t in times]) >= 0)


def test_approach_keeps_all_cycles_and_leaves_an_earlier_approach_unscored():
    cycle = Reference.from_samples([0.0, 5.0, 10.0], [1.0, 5.0, 1.0])
    repeated = cycle.repeated(5, 10.0).with_approach(0.0, 4.0)
    assert (repeated.repeats, repeated.cycle_s, repeated.duration_s) == (5, 10.0, 54.0)
    assert repeated.value_mm(4.0 + 10.0 * 3 + 5.0) == pytest.approx(5.0)
    again = repeated.with_approach(0.0, 6.0)
    assert (again.scored_from_s, again.cycle_s, again.duration_s) == (10.0, 10.0, 60.0)
    assert cycle.without_end(10.0).with_approach(0.0, 4.0).duration_s == math.inf
    with pytest.raises(ConfigError):
        repeated.repeated(2, 10.0)


SINE_KEYS = "low_mm=, high_mm=, period_s=, cycles= (optional: 2)"


@pytest.mark.parametrize(
    ("spec", "what", "cure"),
    [
        ("sinus:low_mm=1", "'sinus'", "did you mean 'sine'?"),
        ("square", "'square'", "known are: chirp, sine, staircase, steps, trapezoid, triangle"),
        ("sine:low=1,high=2,period_s=3", "'low'; did you mean 'low_mm'?", SINE_KEYS),
        ("sine:low_mm=1,high_mm=2", "period_s", SINE_KEYS),
        ("sine", "low_mm, high_mm, period_s", SINE_KEYS),
        ("staircase:low_mm=1", "high_mm", "rise_s= (optional: 2)"),
        ("sine:low_mm=1,high_mm=2,period_s=56,period_s=5", "'period_s'", SINE_KEYS),
        ("sine:low_mm=one,high_mm=2,period_s=3", "'one'", ""),
        ("chirp:low_mm=1,high_mm=2", "start_hz, end_hz", "low_mm=, high_mm=, start_hz=, end_hz=, duration_s="),
    ],
)
def test_wrong_line_is_rejected_with_shapes_or_keys(spec, what, cure):
    with pytest.raises(ConfigError) as error:
        parse_reference(spec)
    assert error.value.where == f"reference '{spec}'"
    assert what in error.value.what
    assert cure in error.value.cure


@pytest.mark.parametrize(
    ("spec", "error", "key"),
    [
        ("sine:low_mm=1,high_mm=2,period_s=0", ConfigError, "period_s"),
        ("sine:low_mm=1,high_mm=2,period_s=-5", ConfigError, "period_s"),
        ("sine:low_mm=1,high_mm=nan,period_s=5", DataError, "high_mm"),
        ("triangle:low_mm=1,high_mm=2,period_s=0", ConfigError, "period_s"),
        ("staircase:low_mm=1,high_mm=2,steps=0", ConfigError, "steps"),
        ("steps:low_mm=1,high_mm=2,dwell_s=0", ConfigError, "dwell_s"),
        ("trapezoid:low_mm=1,high_mm=2,rise_s=-1", ConfigError, "rise_s"),
        ("chirp:low_mm=1,high_mm=2,start_hz=0,end_hz=1", ConfigError, "start_hz"),
    ],
)
def test_value_out_of_bounds_is_rejected_by_its_key(spec, error, key):
    with pytest.raises(error) as caught:
        parse_reference(spec)
    assert caught.value.where == f"reference: {key}"


@pytest.mark.parametrize(
    ("times", "values", "where", "value", "limit"),
    [
        ([0, 1, 1], [0, 1, 2], "reference: time_s of sample 3", "1 s", "1 s"),
        ([0, 2, 1], [0, 1, 2], "reference: time_s of sample 3", "1 s", "2 s"),
        ([0, 1, 2], [0, np.nan, 2], "reference: displacement_mm of sample 2", pytest.approx(np.nan, nan_ok=True), None),
        ([0, 1], [0, 1, 2], "reference", "2 times and 3 displacements", None),
        ([0], [0], "reference", "1 times and 1 displacements", None),
        ([0, 10], [2], "reference", "2 times and 1 displacements", None),
        ([[0, 1]], [[1, 2]], "reference", "shapes (1, 2) and (1, 2)", None),
        ([0, 86_401], [0, 1], "reference", "86401 s", "86400 s"),
        ([0, 1e300], [0, 1], "reference", "1e+300 s", "86400 s"),
        ([-1.7e308, 1.7e308], [0, 1], "reference", "inf s", "86400 s"),
    ],
)
def test_unsuitable_samples_are_rejected(times, values, where, value, limit):
    with pytest.raises(DataError) as error:
        Reference.from_samples(times, values)
    assert (error.value.where, error.value.value, error.value.limit) == (where, value, limit)
    assert error.value.cure


@pytest.mark.parametrize(
    "spec",
    [
        "sine:period_s=1e7",
        "sine:period_s=56,cycles=inf",
        "triangle:period_s=1e7",
        "triangle:period_s=1e-9,cycles=1e12",
        "staircase:steps=1e12",
        "staircase:steps=1e12,dwell_s=1e-12,rise_s=1e-12",
        "steps:cycles=1e12",
        "steps:cycles=1e12,dwell_s=1e-9",
        "trapezoid:rise_s=1e9",
        "trapezoid:cycles=inf",
        "chirp:start_hz=1,end_hz=2,duration_s=1e9",
    ],
)
def test_too_long_reference_is_rejected_before_its_table_is_made(spec):
    with pytest.raises(DataError) as error:
        parse_reference(f"{spec},low_mm=1,high_mm=2")
    assert error.value.where == "reference"
    assert "shorten it" in error.value.cure or "lower the number of" in error.value.cure


@pytest.mark.parametrize(
    ("spec", "value", "limit"),
    [
        ("sine:period_s=0.02,cycles=5000", "10000 in 100 s", "1000 of 0.1 s each"),
        ("sine:period_s=0.19,cycles=2", "4 in 0.38 s", "3.8 of 0.1 s each"),
        ("triangle:period_s=0.05,cycles=100", "200 in 5 s", "50 of 0.1 s each"),
        ("steps:dwell_s=0.05,cycles=100", "200 in 10.05 s", "100.5 of 0.1 s each"),
        ("chirp:start_hz=50,end_hz=50,duration_s=100", "10000 in 100 s", "1000 of 0.1 s each"),
        ("chirp:start_hz=0.1,end_hz=50,duration_s=100", "10000 in 100 s", "1000 of 0.1 s each"),
        ("chirp:start_hz=50,end_hz=0.1,duration_s=100", "10000 in 100 s", "1000 of 0.1 s each"),
    ],
)
def test_swings_that_would_alias_are_rejected(spec, value, limit):
    with pytest.raises(DataError) as error:
        parse_reference(f"{spec},low_mm=2,high_mm=9")
    assert (error.value.where, error.value.value, error.value.limit) == ("reference", value, limit)


@pytest.mark.parametrize("spec", ["sine:period_s=0.2,cycles={}", "chirp:start_hz=5,end_hz=5,duration_s={}"])
@pytest.mark.parametrize("length", [3, 7, 100])
def test_table_contains_all_of_the_fastest_swings(spec, length):
    reference = parse_reference(f"{spec.format(length)},low_mm=2,high_mm=9")
    turns = np.diff(np.sign(np.diff(reference.displacement_mm)))
    assert np.abs(turns).sum() == 2 * (round(reference.duration_s / 0.1) - 1)


@pytest.mark.exhaustive
def test_reference_of_a_day_is_accepted():
    assert Reference.from_samples([0, 43_200, 86_400], [0, 1, 0]).with_approach(0.5, 10.0).duration_s == 86_410.0
    assert parse_reference("sine:low_mm=1,high_mm=2,period_s=43200").duration_s == 86_400.0


def test_reference_within_the_travel_of_the_wire_is_accepted():
    reference = parse_reference("sine:low_mm=2,high_mm=9,period_s=56")
    reference.check_within((0.0, 12.0))
    reference.check_within((12.0, 0.0))  # a displacement that falls on heating


@pytest.mark.parametrize(
    ("high_mm", "ends_mm", "where", "value", "limit"),
    [
        (9, (0.0, 8.0), "reference: highest value", "9 mm", "0 to 8 mm"),
        (9, (3.0, 12.0), "reference: lowest value", "2 mm", "3 to 12 mm"),
        (3000, (0.0, 12.0), "reference: highest value", "3000 mm", "0 to 12 mm"),
        (13, (-0.00598054, 12.0002), "reference: highest value", "13 mm", "-0.006 to 12 mm"),
    ],
)
def test_reference_beyond_the_travel_of_the_wire_is_rejected(high_mm, ends_mm, where, value, limit):
    with pytest.raises(ConfigError) as error:
        parse_reference(f"sine:low_mm=2,high_mm={high_mm},period_s=56").check_within(ends_mm)
    assert (error.value.where, error.value.value, error.value.limit) == (where, value, limit)


@pytest.mark.parametrize(
    ("limits_mm", "where", "limit"),
    [
        ((None, 5.0), "reference: highest value", "displacement_max_mm = 5 mm"),
        ((3.0, None), "reference: lowest value", "displacement_min_mm = 3 mm"),
    ],
)
def test_reference_beyond_the_limits_of_the_rig_is_rejected(limits_mm, where, limit):
    reference = parse_reference("sine:low_mm=2,high_mm=9,period_s=56").with_approach(0.0, 10.0)
    check_rig_limits(reference.scored_mm, None, None)
    check_rig_limits(reference.scored_mm, 2.0, 9.0)
    with pytest.raises(ConfigError) as error:
        check_rig_limits(reference.scored_mm, *limits_mm)
    assert (error.value.where, error.value.limit) == (where, limit)


def test_approach_may_begin_outside_the_travel():
    reference = parse_reference("sine:low_mm=2,high_mm=9,period_s=56").with_approach(-0.002, 10.0).without_end(10.0)
    reference.check_within((1.95, 9.01))
    with pytest.raises(ConfigError) as error:
        reference.check_within((2.5, 9.01))
    assert error.value.where == "reference: lowest value"


def test_endless_reference_begins_again_after_the_approach():
    once = parse_reference("sine:low_mm=2,high_mm=9,period_s=20,cycles=1").with_approach(0.5, 10.0)
    reference = once.without_end(return_s=5.0)
    assert reference.duration_s == math.inf
    assert reference.cycle_s == pytest.approx(20.0)
    assert [reference.value_mm(t) for t in (0.0, 20.0)] == [once.value_mm(t) for t in (0.0, 20.0)]
    assert reference.value_mm(47.0) == pytest.approx(once.value_mm(27.0))
    assert [reference.cycle(t) for t in (0.0, 29.9, 30.1, 1030.1)] == [0, 0, 1, 51]


def test_endless_reference_returns_to_its_beginning_without_a_jump():
    reference = Reference.from_samples([0.0, 10.0], [1.0, 5.0]).without_end(return_s=4.0)
    assert reference.cycle_s == pytest.approx(14.0)
    values = np.array([reference.value_mm(t) for t in np.arange(0.0, 42.0, 0.05)])
    assert np.abs(np.diff(values)).max() < 0.15


def test_next_reversal_is_found():
    trapezoid = Reference.from_samples([0, 2, 5, 7, 9, 11], [1, 3, 3, 1, 1, 2])
    assert trapezoid.next_reversal_s(0.0, 1) == 5.0
    assert trapezoid.next_reversal_s(4.9, 1) == 5.0
    assert trapezoid.next_reversal_s(5.0, -1) == 9.0
    assert trapezoid.next_reversal_s(0.0, -1) == 9.0
    assert trapezoid.next_reversal_s(9.0, 1) == float("inf")


def test_next_reversal_of_an_endless_reference_is_found():
    reference = Reference.from_samples([0, 2, 5, 7], [1, 3, 3, 1]).without_end(return_s=1.0)
    assert reference.next_reversal_s(0.0, 1) == 5.0
    assert reference.next_reversal_s(5.5, -1) == pytest.approx(7.0)
    assert reference.next_reversal_s(5.5 + 700.0, -1) == pytest.approx(707.0)
    assert reference.next_reversal_s(8.0, 1) == pytest.approx(12.0)


GOOD = {"low_mm": 2.0, "high_mm": 9.0, "period_s": 8.0, "cycles": 2.0, "steps": 4.0, "dwell_s": 5.0, "rise_s": 2.0}
GOOD |= {"start_hz": 0.02, "end_hz": 0.1, "duration_s": 40.0}
KEYS = {shape: [key for key in signature(make).parameters if key in GOOD] for shape, make in SHAPES.items()}


def spec_of(shape, **changes):
    """Return the line of a valid reference with `changes`."""
    return f"{shape}:" + ",".join(f"{key}={changes.get(key, GOOD[key])!r}" for key in KEYS[shape])


@pytest.mark.parametrize("shape", SHAPES)
def test_default_values_of_the_next_test_are_valid(shape):
    assert set(KEYS[shape]) == set(signature(SHAPES[shape]).parameters) - {"longest_s"}
    assert parse_reference(spec_of(shape)).duration_s > 1.0


@pytest.mark.parametrize("value", ["nan", "inf", "-inf", "-1e308", "1e308", "0", "-1"])
@pytest.mark.parametrize(("shape", "key"), [(shape, key) for shape, keys in KEYS.items() for key in keys])
def test_impossible_value_is_rejected(shape, key, value):
    spec = spec_of(shape, **{key: float(value)})
    if key.endswith("_mm") and value in {"0", "-1"}:
        assert parse_reference(spec).displacement_mm.min() == pytest.approx(float(value), abs=0.01)
        return
    with pytest.raises((ConfigError, DataError)) as error:
        parse_reference(spec)
    assert error.value.where in {"reference", f"reference: {key}"}
    assert error.value.value is not None


@given(data=st.data(), shape=st.sampled_from(sorted(SHAPES)))
def test_every_line_gives_a_path_or_an_error(data, shape):
    numbers = st.one_of(st.floats(), st.floats(1e-9, 1e9), st.sampled_from([0.0, -1e308, 1e308, 5e-324]))
    changes = {key: data.draw(st.one_of(st.just(GOOD[key]), numbers), label=key) for key in KEYS[shape]}
    try:
        reference = parse_reference(spec_of(shape, **changes), 60.0)
    except (ConfigError, DataError):
        return
    assert np.all(np.isfinite(reference.displacement_mm))
    assert 0.1 <= reference.duration_s <= 60.0


@pytest.mark.parametrize("value", [1e308, -1e308, 1.1e5])
def test_samples_beyond_the_longest_wire_are_rejected(value):
    with pytest.raises(DataError) as error:
        Reference.from_samples([0, 1, 2], [1.0, value, 1.0])
    assert error.value.where == "reference: displacement_mm of sample 2"
    assert (error.value.value, error.value.limit) == (f"{value:g} mm", "±100000 mm")
