"""The displacement feedforward: targets while the wire moves, waits or is cold; the static map as baseline."""

import numpy as np
import pytest

from smadrive.control.estimation.innovation import DisturbanceEvidence
from smadrive.control.estimation.wire_estimate import WireEstimate
from smadrive.control.feedforward.displacement import (
    BACK,
    BEYOND_C,
    COLD_END,
    COLDER_C,
    MOST_K,
    READY,
    REVERSAL_TOLERANCE,
    WAITING_RANGE_C,
    HysteresisInverse,
)
from smadrive.control.feedforward.power import DisplacementFeedforward
from smadrive.control.feedforward.static_map import StaticMap
from smadrive.errors import DataError
from smadrive.hysteresis import DuhemModel, InverseFeedforward, TriangularSets, TSFuzzyDuhem
from smadrive.hysteresis.reversal import Play
from smadrive.wire.branch_temperatures import BranchTemperatures
from smadrive.wire.heat_balance import HeatBalance
from smadrive.wire.wire_model import WireModel, WireState, travel_mm

WIRE = HeatBalance(0.029, 0.012, 0.83, 22.0, 16.5, -0.12, 0.15)
LOOP = DuhemModel.gaussian(
    mu_heating=90, mu_cooling=69, sigma_heating=5, sigma_cooling=5, scale=12, input_range=(0, 160)
)
FALLING = DuhemModel.gaussian(
    mu_heating=90, mu_cooling=69, sigma_heating=5, sigma_cooling=5, scale=-12, offset=12, input_range=(0, 160)
)


def wire_of(model):
    return WireModel(model, WIRE)


def at_rest(state, unexplained_w=0.0):
    """Return the estimate of a wire that has been at one temperature for a long time."""
    return WireEstimate(state.v, state.v, state, unexplained_w, Play(state.v))


@pytest.mark.parametrize("model", [LOOP, FALLING], ids=["rising", "falling"])
@pytest.mark.parametrize("ahead", [+0.5, +3.0])
def test_target_leads_the_model_to_the_setpoint(model, ahead):
    state = model.initial_state(90.0)
    wanted = state.y + float(np.sign(model.scale)) * ahead
    target = HysteresisInverse(model).target(state, wanted, direction=1)
    assert model.step(state, target.temperature_c).y == pytest.approx(wanted, abs=1e-6)
    later = HysteresisInverse(model).target(state, wanted + 1e-4, direction=1)
    assert (later.temperature_c - target.temperature_c) / 1e-4 == pytest.approx(target.k_per_mm, rel=1e-2)


def test_wire_a_little_ahead_waits_and_does_not_reverse():
    state = LOOP.initial_state(90.0)
    waiting = HysteresisInverse(LOOP).target(state, state.y - 0.05, direction=1)
    assert 89.0 < waiting.temperature_c < 90.0


def test_wire_far_ahead_reverses_along_the_other_branch():
    state = LOOP.initial_state(90.0)
    back = HysteresisInverse(LOOP).target(state, state.y - 1.0, direction=1)
    assert back.temperature_c < 80.0
    assert LOOP.step(state, back.temperature_c).y == pytest.approx(state.y - 1.0, abs=1e-6)


@pytest.mark.parametrize("model", [LOOP, FALLING], ids=["rising", "falling"])
def test_wire_ahead_of_a_fast_reference_does_not_reverse(model):
    """The wire would cool for a quarter of a second; the reference needs an eighth of a second, or five seconds."""
    state, feedforward = model.initial_state(90.0), DisplacementFeedforward(HysteresisInverse(model), wire_of(model))
    setpoint_mm = state.y - 0.025 * model.scale
    waits = feedforward.update(at_rest(state), setpoint_mm, 0.12 * model.scale, direction=1)
    turns = feedforward.update(at_rest(state), setpoint_mm, 0.003 * model.scale, direction=1)
    assert 89.0 < waits.temperature_c < 90.0
    assert turns.temperature_c < 85.0


def test_wire_ahead_of_a_fast_reference_reverses_in_a_disturbance():
    """A load that falls moves the wire away from the reference faster than the reference follows."""
    state, feedforward = LOOP.initial_state(90.0), DisplacementFeedforward(HysteresisInverse(LOOP), wire_of(LOOP))
    loaded = at_rest(state)._replace(evidence=DisturbanceEvidence(level=1.0))
    turns = feedforward.update(loaded, state.y - 0.025 * LOOP.scale, 0.12 * LOOP.scale, direction=1)
    waits = feedforward.update(loaded, state.y - 0.005 * LOOP.scale, 0.12 * LOOP.scale, direction=1)
    assert turns.temperature_c < 85.0
    assert 89.0 < waits.temperature_c < 90.0


@pytest.mark.parametrize("model", [LOOP, FALLING], ids=["rising", "falling"])
def test_wire_that_reverses_does_not_change_its_mind(model):
    """The wire cools for a quarter of a second; the reference would need a whole second."""
    wire, state = wire_of(model), WireState(90.0, model.initial_state(90.0))
    feedforward, rate_mm_per_s, begun_mm = DisplacementFeedforward(HysteresisInverse(model), wire), 0.015, state[1].y
    setpoint_mm = begun_mm - 0.025 * model.scale
    while abs(state.hysteresis.y - begun_mm) < 0.002 * abs(model.scale):
        found = feedforward.update(at_rest(state.hysteresis), setpoint_mm, rate_mm_per_s * model.scale, direction=1)
        assert found.temperature_c < state.temperature_c - 0.5
        state = wire.step(state, 0.0, 0.01)
        setpoint_mm += rate_mm_per_s * model.scale * 0.01


def test_waiting_where_the_branch_is_flat_is_bounded():
    state = LOOP.initial_state(120.0)
    held = HysteresisInverse(LOOP).target(state, state.y - 1e-7, direction=1)
    end = LOOP.offset + (1.0 - COLD_END) * LOOP.scale
    assert held.temperature_c == pytest.approx(BranchTemperatures(LOOP).heating_c(end) - WAITING_RANGE_C, abs=0.5)
    assert held.k_per_mm == 0.0


@pytest.mark.parametrize(("start_c", "direction"), [(120.0, 1), (120.0, -1), (30.0, -1)])
def test_waiting_at_an_end_of_the_travel_does_not_drift(start_c, direction):
    """The wire follows its target again and again; the target stays where it is."""
    inverse, state = HysteresisInverse(LOOP), LOOP.initial_state(start_c)
    setpoint = state.y - direction * 0.004 * LOOP.scale
    targets_c = []
    for _ in range(100):
        target = inverse.target(state, setpoint, direction)
        targets_c.append(target.temperature_c)
        state = LOOP.step(state, target.temperature_c)
    assert not target.reachable
    assert max(targets_c[1:]) - min(targets_c[1:]) < 0.01


@pytest.mark.parametrize(("start_c", "direction"), [(88.0, -1), (95.0, -1), (82.0, 1), (75.0, 1)])
def test_wire_that_waits_does_not_move_back_beyond_the_setpoint(start_c, direction):
    """Both branches are steep at this temperature, so the wire moves whether it is heated or cooled."""
    narrow = DuhemModel.gaussian(
        mu_heating=90, mu_cooling=80, sigma_heating=8, sigma_cooling=8, scale=12, input_range=(0, 160)
    )
    state = narrow.initial_state(start_c, 6.0)
    for lead_mm in (0.0, 0.001, 0.01, 0.1):
        target = HysteresisInverse(narrow).target(state, state.y - direction * lead_mm, direction)
        moved_mm = direction * (narrow.step(state, target.temperature_c).y - state.y)
        assert -(lead_mm + BACK * narrow.scale) - 1e-3 <= moved_mm <= READY * narrow.scale


@pytest.mark.parametrize("model", [LOOP, FALLING], ids=["rising", "falling"])
def test_noise_of_the_estimate_does_not_heat_a_wire_with_a_cold_setpoint(model):
    cold_mm, inverse = travel_mm(model)[0], HysteresisInverse(model)
    for share in (-0.003, -0.001, 0.0, 0.001, 0.003):
        state = model.initial_state(22.0, cold_mm + share * model.scale)
        held = inverse.target(state, cold_mm + 0.002 * model.scale, direction=1)
        assert held[:3] == (model.input_range[0] - COLDER_C, 0.0, cold_mm)
    assert inverse.target(state, cold_mm + 0.01 * model.scale, direction=1).temperature_c > 50.0
    cold = model.initial_state(22.0, cold_mm - 0.001 * model.scale)
    leaving = inverse.target(cold, cold_mm + 0.002 * model.scale, direction=1, rate_mm_per_s=0.01 * model.scale)
    assert leaving.temperature_c > 50.0


def test_power_holds_the_temperature_and_supplies_the_latent_heat():
    state = LOOP.initial_state(90.0)
    feedforward = DisplacementFeedforward(HysteresisInverse(LOOP), WireModel(LOOP, WIRE))
    rate_mm_per_s = 0.4
    found = feedforward.update(at_rest(state), state.y + 1e-3, rate_mm_per_s, direction=1)
    rate_k_per_s = rate_mm_per_s / LOOP.slope(state, 1)
    expected_w = WIRE.power_w(90.0, rate_k_per_s, rate_mm_per_s / LOOP.scale)
    assert found.power_w == pytest.approx(expected_w, rel=0.02)


def test_unexplained_power_is_subtracted():
    state = LOOP.initial_state(90.0)
    powers = [
        DisplacementFeedforward(HysteresisInverse(LOOP), WireModel(LOOP, WIRE))
        .update(at_rest(state, unexplained_w), state.y + 0.01, 0.2, direction=1)
        .power_w
        for unexplained_w in (0.0, 0.1)
    ]
    assert powers[0] - powers[1] == pytest.approx(0.1)


def test_static_map_runs_between_the_branches():
    sweep = np.concatenate((np.linspace(20, 130, 500), np.linspace(130, 20, 500)))
    plain = StaticMap(sweep, LOOP.simulate(sweep))
    state = LOOP.initial_state(20.0)
    middle = plain.target(state, 6.0, direction=1)
    assert 69.0 < middle.temperature_c < 90.0
    assert middle[:2] == plain.target(LOOP.initial_state(120.0), 6.0, direction=-1)[:2]
    assert plain.target(state, -5.0, 1).k_per_mm == plain.target(state, 50.0, 1).k_per_mm == 0.0


def test_static_map_of_a_falling_output_falls():
    sweep = np.concatenate((np.linspace(20, 130, 500), np.linspace(130, 20, 500)))
    plain = StaticMap(sweep, FALLING.simulate(sweep))
    state = FALLING.initial_state(20.0)
    assert plain.target(state, 1.0, 1).temperature_c > plain.target(state, 11.0, 1).temperature_c


def test_static_map_of_different_lengths_is_rejected():
    with pytest.raises(DataError) as error:
        StaticMap([1.0, 2.0], [1.0])
    assert (error.value.where, error.value.value) == ("static map", ((2,), (1,)))


def test_holding_a_temperature_takes_the_loss_and_no_more():
    estimate = at_rest(LOOP.initial_state(90.0), unexplained_w=0.1)
    held = DisplacementFeedforward(HysteresisInverse(LOOP), WireModel(LOOP, WIRE)).hold(estimate, 75.0, 6.0)
    assert held.temperature_c == 75.0
    assert held.power_w == pytest.approx(WIRE.loss_w_per_k * (75.0 - WIRE.ambient_c) - 0.1)


def test_foot_of_a_branch_requests_no_unlimited_rate():
    """The wire has turned at the cold end of a loop: the heating branch hardly moves it at first."""
    state = LOOP.step(LOOP.initial_state(100.0), 62.0)
    target = HysteresisInverse(LOOP).target(state, state.y + 1e-9, direction=1)
    assert target.temperature_c >= 62.0
    assert target.k_per_mm == pytest.approx(MOST_K / LOOP.scale)


def test_stuck_displacement_requests_no_temperature_far_above_the_branch():
    """The sensor shows a displacement that a wire at 104 °C cannot have."""
    model = TSFuzzyDuhem.from_duhem(LOOP, TriangularSets(tuple(np.linspace(40.0, 120.0, 17).tolist())))
    inverse, stuck = HysteresisInverse(model), model.initial_state(104.0, 8.0)
    needed = inverse.target(model.initial_state(20.0), 9.0, direction=1)
    assert stuck.y == pytest.approx(8.0)
    assert InverseFeedforward(model).update(stuck, 9.0).v > 104.0
    assert inverse.target(stuck, 9.0, direction=1).temperature_c == pytest.approx(
        needed.temperature_c + BEYOND_C, abs=0.1
    )


@pytest.mark.parametrize("ambient_c", [54.0, 58.0])
def test_cold_wire_does_not_wait_until_it_cannot_get_colder(ambient_c):
    cold = LOOP.initial_state(53.0)

    def cooling_s(from_c, to_c):
        return np.log((from_c - ambient_c) / (to_c - ambient_c)) if to_c > ambient_c else np.inf

    target = HysteresisInverse(LOOP).target(cold, 8.0, direction=-1, rate_mm_per_s=-0.02, cooling_s=cooling_s)
    assert target.temperature_c > 85.0


@pytest.mark.parametrize("model", [LOOP, FALLING], ids=["rising", "falling"])
def test_noise_does_not_change_the_decision_to_wait_or_to_turn_back(model):
    state, inverse, sense = model.initial_state(90.0), HysteresisInverse(model), float(np.sign(model.scale))
    for noise in (-0.0015, -0.0005):
        setpoint_mm = state.y - sense * 12.0 * (REVERSAL_TOLERANCE + noise)
        waiting, turning = (
            inverse.target(state, setpoint_mm, 1, turns_back=turns_back) for turns_back in (False, True)
        )
        assert (waiting.turns_back, turning.turns_back) == (False, True)
        assert turning.temperature_c < 85.0 < waiting.temperature_c


@pytest.mark.parametrize(("lead", "turns_back"), [(0.007, False), (0.011, True)])
def test_lead_beyond_the_noise_decides(lead, turns_back):
    state, inverse = LOOP.initial_state(90.0), HysteresisInverse(LOOP)
    for before in (False, True):
        assert inverse.target(state, state.y - 12.0 * lead, 1, turns_back=before).turns_back == turns_back
