"""Rules with memory: the plane against a bank of relays, wiping-out, return to turning points, inverse, model file."""

import json
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from smadrive.errors import ModelError
from smadrive.hysteresis import (
    DuhemModel,
    InverseFeedforward,
    PreisachPlane,
    TriangularSets,
    TSFuzzyDuhem,
    TSFuzzyPreisach,
    load_model,
    save_model,
)
from smadrive.hysteresis.memory.plane import in_plane
from smadrive.hysteresis.turning_points import MOST_TURNS

LOWER, UPPER = 20.0, 130.0
UP, DOWN = np.linspace(70.0, 110.0, 21), np.linspace(48.0, 89.0, 18)
RULES = TSFuzzyDuhem.from_duhem(
    DuhemModel.gaussian(
        mu_heating=90.0,
        mu_cooling=69.0,
        sigma_heating=5.0,
        sigma_cooling=5.0,
        scale=-4.0,
        offset=4.3,
        input_range=(LOWER, UPPER),
    ),
    TriangularSets(tuple(np.linspace(25.0, 125.0, 15))),
)


def random_plane(seed=1):
    cells = in_plane(UP, DOWN)
    mass = np.random.default_rng(seed).random(cells.shape) ** 3 * cells
    return PreisachPlane(UP, DOWN, mass / mass.sum())


PLANE = random_plane()
MODELS = {share: TSFuzzyPreisach(RULES, PLANE, share) for share in (0.01, 0.5, 1.0)}
inputs = st.floats(LOWER - 10, UPPER + 10)
paths = st.lists(inputs, min_size=2, max_size=25)
any_model = st.sampled_from(list(MODELS.values()))


def walk(model, path):
    state = model.initial_state(path[0])
    states = [state]
    for v in path[1:]:
        state = model.step(state, v)
        states.append(state)
    return states


class Relays:
    """A bank of relays: `count` in each cell along both axes, evenly spaced, all starting from the cold end."""

    def __init__(self, plane, count):
        inside = (np.arange(count) + 0.5) / count
        up = (plane.up_thresholds[:-1, None] + np.diff(plane.up_thresholds)[:, None] * inside).ravel()
        down = (plane.down_thresholds[:-1, None] + np.diff(plane.down_thresholds)[:, None] * inside).ravel()
        self.up, self.down = up[:, None], down[None, :]
        self.mass = np.kron(plane.mass, np.full((count, count), 1 / count**2))

    def states(self, path):
        on = np.broadcast_to(self.up <= path[0], self.mass.shape)
        found = [self.mass[on].sum()]
        for before, after in pairwise(path):
            on = on | (self.up <= after) if after > before else on & (self.down < after)
            found.append(self.mass[on].sum())
        return np.array(found)


def test_the_plane_is_a_bank_of_relays():
    path = np.concatenate([[LOWER], np.random.default_rng(2).uniform(50.0, 110.0, 60)])
    p = [state.memory.plane for state in walk(MODELS[1.0], path)]
    for count in (4, 16):
        resolution = max(PLANE.mass.sum(axis=axis).max() for axis in (0, 1)) / count
        assert np.abs(Relays(PLANE, count).states(path) - p).max() < resolution


def test_a_plane_with_a_narrow_cell_for_each_relay_is_the_bank():
    """The bank has 64 x 63 = 4,032 relays of random mass."""
    ups, downs = np.linspace(75.0, 110.0, 64), np.linspace(48.0, 74.0, 63)
    mass = np.random.default_rng(7).random((64, 63))
    mass /= mass.sum()
    cells = np.zeros((127, 125))
    cells[::2, ::2] = mass
    narrow = np.array([-1e-9, 1e-9])
    plane = PreisachPlane(*((relays[:, None] + narrow).ravel() for relays in (ups, downs)), cells)
    path = np.concatenate([[LOWER], np.random.default_rng(2).uniform(50.0, 110.0, 2000)])
    model = TSFuzzyPreisach(RULES, plane, 1.0)
    on, bank = np.zeros_like(mass, dtype=bool), []
    for v in path:
        on = (on | (ups <= v)[:, None]) & (downs < v)
        bank.append(mass[on].sum())
    assert np.abs((model.simulate(path) - model.offset) / model.scale - bank).max() < 1e-9
    assert np.abs([state.w for state in walk(model, path)] - np.array(bank)).max() < 1e-9


@pytest.mark.parametrize("share", MODELS)
def test_a_section_solves_the_differential_equation(share):
    model = MODELS[share]
    start = walk(model, [LOWER, 104.0, 66.0, 92.0, 71.0])[-1]
    ends = np.linspace(71.0, 91.0, 41)[1:]
    edges = np.concatenate([[71.0], UP[(UP > 71.0) & (UP < 91.0)], [91.0]])
    w, found = start.w, []
    x = start.memory.local
    for left, right in pairwise(edges):
        middle = 0.5 * (left + right)
        plane_slope = PLANE.slope(middle, 71.0, rising=True)
        inside = ends[(ends > left) & (ends <= right)]

        def law(v, now, plane_slope=plane_slope):
            return [
                model.local.engine.slope(now[0], v, True),
                share * plane_slope + (1 - share) * model.local.engine.slope(now[0], v, True),
            ]

        way = solve_ivp(
            law, (left, right), [x, w], "DOP853", t_eval=np.unique([*inside, right]), rtol=1e-12, atol=1e-13
        )
        found += way.y[1][: len(inside)].tolist()
        x, w = way.y[:, -1]
    exact = [model.step(start, v).w for v in ends]
    np.testing.assert_allclose(exact, found, rtol=0, atol=1e-9)


@given(any_model, paths)
def test_simulate_is_step_by_step(model, path):
    y = [state.y for state in walk(model, path)]
    np.testing.assert_allclose(model.simulate(path), y, rtol=0, atol=1e-12)


@given(any_model, paths, st.integers(2, 6))
def test_rate_independence(model, path, repeats):
    slow = np.interp(np.arange(repeats * (len(path) - 1) + 1) / repeats, np.arange(len(path)), path)
    np.testing.assert_allclose(model.simulate(slow)[::repeats], model.simulate(path), rtol=0, atol=1e-11)


@given(any_model, paths)
def test_bounded_and_alternating_turning_points(model, path):
    for state in walk(model, path):
        assert -1e-12 <= state.w <= 1 + 1e-12
        turns = state.memory.turns
        assert turns[0] == LOWER
        minima, maxima = turns[::2], turns[1::2]
        assert list(minima) == sorted(minima)
        assert list(maxima) == sorted(maxima, reverse=True)
        low, high = (PLANE.branch(min(max(state.v, LOWER), UPPER), rising=rising) for rising in (True, False))
        assert low <= state.memory.plane <= high


@given(paths, st.floats(0.0, 1.0), inputs)
def test_wiping_out(before, place, after):
    """A closed excursion to an input that lies after the last turning point leaves no trace in the plane."""
    state = walk(MODELS[1.0], before)[-1]
    excursion = state.memory.turns[-1] + place * (min(max(state.v, LOWER), UPPER) - state.memory.turns[-1])
    returned = walk(MODELS[1.0], [*before, excursion, state.v])[-1]
    assert returned.memory.plane == pytest.approx(state.memory.plane, abs=1e-12)
    later, unmoved = MODELS[1.0].step(returned, after), MODELS[1.0].step(state, after)
    assert later.memory.plane == pytest.approx(unmoved.memory.plane, abs=1e-12)


@given(paths, paths, st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_congruency_of_minor_loops(one, other, first, last):
    """Loops between the same two inputs have one shape, whatever came before."""
    low = 55.0 + 20.0 * first
    high = low + 30.0 * last
    changes = []
    for before in (one, other):
        state = walk(MODELS[1.0], [*before, high, low])[-1]
        changes.append(MODELS[1.0].step(state, high).memory.plane - state.memory.plane)
    assert changes[0] == pytest.approx(changes[1], abs=1e-12)


@given(any_model, paths, st.lists(st.floats(0.0, 1.0), min_size=1, max_size=10))
def test_inverse_round_trip(model, path, places):
    state, inverse = walk(model, path)[-1], InverseFeedforward(model)
    for place in places:
        setpoint = model.offset + model.scale * place
        inversion = inverse.update(state, setpoint)
        state = model.step(state, inversion.v)
        assert state.y == pytest.approx(inversion.y, abs=1e-8)
        if inversion.reachable:
            assert state.y == pytest.approx(setpoint, abs=1e-8)


@given(any_model, st.floats(LOWER, UPPER), st.floats(0.0, 1.0))
def test_initial_state_has_the_output(model, v, place):
    low, high = (float(model.branch(np.array([v]), rising=rising)[0]) for rising in (True, False))
    y = model.offset + model.scale * (low + place * (high - low))
    state = model.initial_state(v, y)
    assert state.y == pytest.approx(y, abs=1e-9)
    top = model.step(state, UPPER)
    assert top.memory.plane == pytest.approx(1.0, abs=1e-9)
    assert model.step(top, v).memory.plane == pytest.approx(PLANE.branch(v, rising=False), abs=1e-9)


@given(any_model, paths, st.floats(-2.0, 2.0))
def test_corrected_makes_no_turning_point(model, path, change):
    state = walk(model, path)[-1]
    found = model.corrected(state, state.v + change, state.y)
    assert found.v == state.v + change
    assert len(found.memory.turns) <= len(state.memory.turns)


@given(any_model, paths, st.floats(-0.2, 0.2))
def test_corrected_takes_the_output_as_far_as_possible(model, path, change):
    state = walk(model, path)[-1]
    v = min(max(state.v, LOWER), UPPER)
    low, high = model.admissible(v)
    wanted = model.offset + model.scale * (state.w + change)
    found = model.corrected(state, state.v, wanted)
    assert low - 1e-12 <= found.w <= high + 1e-12
    assert abs(found.y - wanted) <= abs(state.y - wanted) + 1e-9
    assert found.w == pytest.approx(min(max(state.w + change, low), high), abs=1e-9)


def test_the_stack_is_bounded_and_tells_what_it_dropped():
    model, half_k = MODELS[1.0], 20.0
    path = [LOWER, *(80.0 + (-1) ** number * half_k * (1 - number / 200) for number in range(MOST_TURNS + 20))]
    states = walk(model, path)
    assert max(len(state.memory.turns) for state in states) <= MOST_TURNS
    assert states[-1].memory.dropped > 0
    np.testing.assert_allclose(model.simulate(path), [state.y for state in states], rtol=0, atol=1e-9)


def test_the_rules_give_the_slope():
    state = walk(MODELS[1.0], [LOWER, 101.0, 66.0, 85.3])[-1]
    turn = 66.0
    near = np.searchsorted(DOWN, turn) - 1
    weight = (turn - DOWN[near]) / (DOWN[near + 1] - DOWN[near])
    strengths = {DOWN[near]: 1 - weight, DOWN[near + 1]: weight}
    fired = [rule for rule in PLANE.rules if rule.direction > 0 and rule.lower <= 85.3 < rule.upper]
    slope = sum(rule.b * strengths.get(rule.turn, 0.0) for rule in fired)
    assert MODELS[1.0].slope(state, 1) == pytest.approx(MODELS[1.0].scale * slope)
    assert str(fired[0]).startswith("IF v is from ")


def test_model_file_round_trip(tmp_path):
    model = MODELS[0.5]
    save_model(model, tmp_path / "wire.json")
    loaded = load_model(tmp_path / "wire.json")
    assert isinstance(loaded, TSFuzzyPreisach)
    path = np.random.default_rng(3).uniform(LOWER, UPPER, 50)
    np.testing.assert_array_equal(loaded.simulate(path), model.simulate(path))


def test_a_file_of_version_1_is_read(tmp_path):
    save_model(RULES, tmp_path / "wire.json")
    document = json.loads((tmp_path / "wire.json").read_text())
    document["schema"] = 1
    (tmp_path / "wire.json").write_text(json.dumps(document))
    assert type(load_model(tmp_path / "wire.json")) is TSFuzzyDuhem


@pytest.mark.parametrize(
    "change",
    [
        {"share": 0},
        {"share": 1.5},
        {"mass": [1.0]},
        {"mass": "x"},
        {"up_thresholds": [1.0]},
        {"up_thresholds": [3.0, 2.0]},
        {"down_thresholds": None},
    ],
)
def test_a_broken_memory_is_refused(tmp_path, change):
    save_model(MODELS[0.5], tmp_path / "wire.json")
    document = json.loads((tmp_path / "wire.json").read_text())
    document["memory"].update(change)
    (tmp_path / "wire.json").write_text(json.dumps(document))
    with pytest.raises(ModelError) as caught:
        load_model(tmp_path / "wire.json")
    assert "memory" in str(caught.value) or "Preisach" in str(caught.value)


def test_relays_below_the_diagonal_are_refused():
    with pytest.raises(ModelError):
        PreisachPlane([60.0, 70.0], [80.0, 90.0], [[1.0]])


def test_a_state_of_another_model_is_refused():
    with pytest.raises(ModelError):
        MODELS[0.5].step(RULES.initial_state(60.0), 70.0)


@given(share=st.sampled_from([0.5, 1.0]), path=paths, further=paths)
def test_another_model_of_the_wire_continues_from_its_turning_points(share, path, further):
    """The rules alone forget the turning points that were wiped out, so they are only close."""
    model, equal = MODELS[share], TSFuzzyPreisach(RULES, random_plane(), share)
    state = walk(model, path)[-1]
    other = equal.adopted(state, model)
    assert other.y == pytest.approx(state.y, abs=1e-9)
    for v in further:
        state, other = model.step(state, v), equal.step(other, v)
        assert other.y == pytest.approx(state.y, abs=(1e-9 if share == 1.0 else 0.02) * abs(model.scale))


def test_state_of_the_same_model_stays_as_it_is():
    state = walk(MODELS[0.5], [20.0, 100.0, 62.0, 86.0])[-1]
    assert MODELS[0.5].adopted(state, MODELS[0.5]) is state
