"""The preview begins a reversal neither so late that the wire lags, nor so early that it misses the peak."""

import numpy as np
import pytest

from smadrive.control.estimation.wire_estimate import WireEstimate
from smadrive.control.feedforward.reversal_preview import ReversalPreview
from smadrive.control.references.reference import Reference
from smadrive.hysteresis import DuhemModel, InverseFeedforward
from smadrive.hysteresis.reversal import Play
from smadrive.wire.heat_balance import HeatBalance
from smadrive.wire.wire_model import WireModel, WireState

LOOP = DuhemModel.gaussian(
    mu_heating=90, mu_cooling=69, sigma_heating=5, sigma_cooling=5, scale=12, input_range=(0, 160)
)
FALLING = DuhemModel.gaussian(
    mu_heating=90, mu_cooling=69, sigma_heating=5, sigma_cooling=5, scale=-12, offset=12, input_range=(0, 160)
)
BALANCE = HeatBalance(0.029, 0.012, 0.83, 22.0, 16.5, -0.12, 0.15)
PEAK_S = 10.0
POWERS_W = (0.0, 5.0)
"""The least and the largest power."""


def peak(rate=0.4, model=LOOP):
    """A triangle that reverses at `PEAK_S`, at 70 % of the stroke."""
    top_mm = model.offset + 0.7 * model.scale
    down_mm = top_mm - np.sign(model.scale) * rate * PEAK_S
    return Reference.from_samples([0, PEAK_S, 2 * PEAK_S], [down_mm, top_mm, down_mm])


def at(reference, time_s, model=LOOP):
    """A wire that has followed the reference along the heating branch up to this time."""
    phase = (reference.value_mm(time_s) - model.offset) / model.scale
    temperatures = np.linspace(60, 120, 6001)
    state = model.initial_state(float(temperatures[np.searchsorted(model.heating.cdf(temperatures), phase)]))
    return WireEstimate(state.v, state.v, state, 0.0, Play(state.v, 1))


def leaves_s(reference, model=LOOP):
    """Return the time at which the wire leaves the heating branch."""
    preview = ReversalPreview(WireModel(model, BALANCE), 0.02)
    for time_s in np.arange(8.0, PEAK_S + 0.01, 0.02).tolist():
        if turn := preview.update(at(reference, time_s, model), reference, time_s, 1, POWERS_W):
            return time_s, turn
    return None


def largest_error(reference, leave_s):
    """Return the largest error of a wire that leaves the reference at `leave_s` and cools until they meet again."""
    wire, estimate = WireModel(LOOP, BALANCE), at(reference, leave_s)
    state, time_s = WireState(estimate.temperature_c, estimate.hysteresis), leave_s
    early = late = error = 0.0
    while time_s < PEAK_S + 0.2 or error < 0.0:
        state, time_s = wire.step(state, 0.0, 0.01), time_s + 0.01
        error = reference.value_mm(time_s) - state.hysteresis.y
        early, late = max(early, error), max(late, -error)
    return max(early, late)


def test_wire_reverses_before_the_peak_and_meets_the_reference_after_the_peak():
    leave_s, turn = leaves_s(peak())
    assert PEAK_S - 0.8 < leave_s < PEAK_S - 0.1
    assert turn.meets_s > PEAK_S
    assert turn.direction == -1
    assert turn.meets_c < at(peak(), leave_s).temperature_c - 5.0


def test_time_of_the_reversal_minimises_the_largest_error():
    reference = peak()
    leave_s, _ = leaves_s(reference)
    chosen = largest_error(reference, leave_s)
    assert chosen < 0.65 * largest_error(reference, PEAK_S)
    assert chosen < 1.1 * min(largest_error(reference, t) for t in np.arange(9.0, 10.0, 0.02).tolist())


def test_displacement_that_falls_on_heating_reverses_at_the_same_time():
    assert leaves_s(peak(model=FALLING), FALLING)[0] == pytest.approx(leaves_s(peak())[0])


def test_wire_reverses_after_a_peak_at_which_the_reference_rests_for_a_moment():
    """The reference slowly leaves its peak and then falls as fast as in the other tests."""
    top_mm = 0.7 * LOOP.scale
    rests = Reference.from_samples(
        [0, PEAK_S, PEAK_S + 0.5, 2 * PEAK_S], [0.0, top_mm, top_mm - 0.01, top_mm - 0.01 - 0.4 * 9.5]
    )
    preview, wire = ReversalPreview(WireModel(LOOP, BALANCE), 0.02), at(rests, PEAK_S)
    assert preview.update(wire, rests, PEAK_S + 0.02, -1, POWERS_W) is None
    late = (preview.update(wire, rests, time_s, -1, POWERS_W) for time_s in np.arange(PEAK_S, PEAK_S + 0.5, 0.02))
    reversal = next(filter(None, late))
    assert reversal.direction == -1
    assert PEAK_S + 0.5 < reversal.meets_s < PEAK_S + 1.5
    assert reversal.meets_c < wire.temperature_c - 5.0


def test_no_reversal_begins_after_a_peak_from_which_the_wire_follows_the_reference():
    preview, reference = ReversalPreview(WireModel(LOOP, BALANCE), 0.02), peak()
    state = LOOP.initial_state(at(reference, PEAK_S).temperature_c)
    time_s = PEAK_S + 0.3
    state = InverseFeedforward(LOOP).update(state, reference.value_mm(time_s)).state
    wire = WireEstimate(state.v, state.v, state, 0.0, Play(state.v, -1))
    assert preview.update(wire, reference, time_s, -1, POWERS_W) is None


def test_no_reversal_begins_far_from_the_peak():
    reference = peak()
    preview = ReversalPreview(WireModel(LOOP, BALANCE), 0.02)
    assert preview.update(at(reference, 5.0), reference, 5.0, 1, POWERS_W) is None


def test_reversal_is_over_at_or_beyond_the_meeting_point():
    _, turn = leaves_s(peak())
    before = at(peak(), 9.5).hysteresis
    assert not turn.is_over(turn.meets_s - 0.1, before, LOOP.scale)
    assert turn.is_over(turn.meets_s, before, LOOP.scale)
    beyond = before._replace(y=turn.meets_mm - 0.02 * LOOP.scale)
    assert turn.is_over(turn.meets_s - 0.1, beyond, LOOP.scale)
