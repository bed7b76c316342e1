"""The inverse: a reachable setpoint is reached, an unreachable one gives the end of the range and reachable = False."""

import numpy as np
import pytest

from smadrive.errors import DataError
from smadrive.hysteresis import InverseFeedforward


def outputs(model, shares):
    return model.offset + model.scale * np.asarray(shares)


def test_round_trip(model):
    wanted = outputs(model, 0.5 + 0.4 * np.sin(np.linspace(0, 20, 300)))
    start = model.initial_state(model.input_range[0])
    result = InverseFeedforward(model).trajectory(wanted, start.v)
    assert result.reachable.all()
    reached = model.simulate(np.concatenate([[start.v], result.v]), start.y)[1:]
    np.testing.assert_allclose(reached, wanted, rtol=0, atol=1e-8 * abs(model.scale))
    np.testing.assert_allclose(result.y, wanted, rtol=0, atol=1e-8 * abs(model.scale))


def test_random_setpoints_are_reached_or_reported_unreachable(model):
    wanted = outputs(model, np.random.default_rng(3).uniform(0.02, 0.98, 500))
    result = InverseFeedforward(model).trajectory(wanted, model.input_range[0])
    assert result.reachable.all()
    np.testing.assert_allclose(result.y, wanted, rtol=0, atol=1e-9 * abs(model.scale))


def test_unreachable_setpoint_gives_the_end_of_the_range(model):
    result = InverseFeedforward(model).trajectory(outputs(model, [0.5, 1.3, -0.3]), model.input_range[0])
    assert result.reachable.tolist() == [True, False, False]
    assert result.v[1:].tolist() == [model.engine.upper, model.engine.lower]


def test_setpoint_at_the_present_output_needs_no_move(model):
    state = model.initial_state(0.5 * sum(model.input_range))
    assert InverseFeedforward(model).update(state, state.y) == (state, True)


def test_state_outside_the_range_is_brought_back(model):
    state = model.initial_state(model.input_range[1] + 50.0, model.offset + model.scale)
    inversion = InverseFeedforward(model).update(state, model.offset + 0.5 * model.scale)
    assert inversion.reachable
    assert model.step(state, inversion.v).y == pytest.approx(inversion.y, abs=1e-9 * abs(model.scale))


def test_setpoints_that_are_not_finite_are_rejected(model):
    inverse = InverseFeedforward(model)
    with pytest.raises(DataError) as error:
        inverse.update(model.initial_state(0.0), float("nan"))
    assert error.value.where == "output setpoint"
    with pytest.raises(DataError) as error:
        inverse.trajectory([0.0, np.inf], 0.0)
    assert error.value.where == "reference y_ref: index 1"
    with pytest.raises(DataError) as error:
        inverse.trajectory(np.zeros((3, 2)), 0.0)
    assert error.value.value == (3, 2)
