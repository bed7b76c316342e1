"""The wire model steps heat and transformation together, and its result does not depend on the step."""

import numpy as np
import pytest

from smadrive.hysteresis import DuhemModel, TriangularSets, TSFuzzyDuhem
from smadrive.wire.heat_balance import HeatBalance
from smadrive.wire.wire_model import WireModel, WireState

WIRE = WireModel(
    DuhemModel.gaussian(mu_heating=90, mu_cooling=69, sigma_heating=5, sigma_cooling=5, scale=12, input_range=(0, 160)),
    HeatBalance(0.029, 0.012, 0.83, 22.0, 16.5, -0.12, 0.15),
)


def run(power_w, start_c, seconds, steps):
    state = WireState(start_c, WIRE.model.initial_state(start_c))
    for _ in range(steps):
        state = WIRE.step(state, power_w, seconds / steps)
    return state


@pytest.mark.parametrize(("power_w", "start_c"), [(5.0, 30.0), (1.1, 80.0), (0.0, 110.0)])
def test_long_step_ends_where_many_short_ones_end(power_w, start_c):
    long, short = run(power_w, start_c, 0.4, 1), run(power_w, start_c, 0.4, 2000)
    assert long.temperature_c == pytest.approx(short.temperature_c, abs=0.1)
    assert long.hysteresis.w == pytest.approx(short.hysteresis.w, abs=0.005)


def test_heat_is_conserved():
    """Heat that is neither stored nor used by the transformation is lost to the surroundings."""
    state, lost_j = WireState(30.0, WIRE.model.initial_state(30.0)), 0.0
    for _ in range(4000):
        after = WIRE.step(state, 2.0, 5e-4)
        lost_j += 5e-4 * WIRE.balance.loss_w_per_k * (0.5 * (state.temperature_c + after.temperature_c) - 22.0)
        state = after
    stored_j = WIRE.balance.heat_capacity_j_per_k * (state.temperature_c - 30.0)
    transformed_j = WIRE.balance.latent_heat_j * state.hysteresis.w
    assert stored_j + transformed_j + lost_j == pytest.approx(2.0 * 2.0, rel=1e-3)


def test_slope_is_that_of_the_phase_also_where_displacement_falls_on_heating():
    falling = DuhemModel.gaussian(
        mu_heating=90, mu_cooling=69, sigma_heating=5, sigma_cooling=5, scale=-12, offset=12, input_range=(0, 160)
    )
    wire = WireModel(falling, WIRE.balance)
    state = falling.initial_state(88.0)
    assert wire.phase_per_k(state, 1) == pytest.approx(WIRE.phase_per_k(WIRE.model.initial_state(88.0), 1))


@pytest.mark.parametrize("power_w", [0.0, 0.3, 1.4, 5.0])
def test_state_outside_the_branches_gives_no_heat(power_w):
    centres = np.linspace(40.0, 120.0, 41)
    pull = np.full(41, 0.1)
    up, down = (0.5 + 0.5 * np.tanh((centres - middle_c) / 6.0) for middle_c in (90.0, 69.0))
    model = TSFuzzyDuhem(
        TriangularSets(tuple(centres)),
        a_heating=-pull,
        b_heating=pull * up,
        a_cooling=pull,
        b_cooling=-pull * down,
        scale=12.0,
        input_range=(0.0, 160.0),
    )
    wire = WireModel(model, WIRE.balance)
    settled_c = 22.0 + power_w / WIRE.balance.loss_w_per_k
    for start_c in np.linspace(40.0, 120.0, 81).tolist():
        for start_mm in (0.0, 2.0, 10.0, 12.0):
            state = WireState(start_c, model.initial_state(start_c, start_mm))
            after_c = wire.step(state, power_w, 0.05).temperature_c
            assert min(start_c, settled_c) <= after_c <= max(start_c, settled_c)


def test_model_that_uses_a_part_of_its_state_takes_the_same_heat():
    """An identified model may have a scale larger than the stroke. Its state then stays below 1."""
    sets = TriangularSets(tuple(np.linspace(40.0, 120.0, 41)))
    whole = TSFuzzyDuhem.from_duhem(WIRE.model, sets)
    (a_up, b_up), (a_down, b_down) = whole.heating_law, whole.cooling_law
    part = TSFuzzyDuhem(
        sets,
        a_heating=a_up,
        b_heating=b_up / 1.6,
        a_cooling=a_down,
        b_cooling=b_down / 1.6,
        scale=1.6 * whole.scale,
        input_range=whole.input_range,
    )
    states = []
    for model in (whole, part):
        wire = WireModel(model, WIRE.balance)
        state = WireState(60.0, model.initial_state(60.0))
        for _ in range(40):
            state = wire.step(state, 1.4, 0.05)
        states.append(
            (
                state.temperature_c,
                wire.phase(state.hysteresis),
                wire.resistance_ohm(state.hysteresis, state.temperature_c),
            )
        )
    assert 0.2 < states[0][1] < 0.9
    assert states[1] == pytest.approx(states[0], rel=1e-6)
