"""A wire that ages while it works, and rules that follow it: all the way, from its registers to those in force."""

import numpy as np

STROKE_MM, MINUTES, SINE_S = 12.0, 6, 40.0


def rms_percent(wire, models):
    """How far each model is off the true wire over the sine before its time, all together, in % of the stroke."""
    times_s, wire_c, reached_mm = np.array(wire).T
    errors = []
    for time_s, model in models:
        there = (times_s > time_s - SINE_S) & (times_s <= time_s)
        state = model.initial_state(wire_c[there][0], reached_mm[there][0])
        for v, mm in zip(wire_c[there].tolist(), reached_mm[there].tolist(), strict=True):
            state = model.step(state, v)
            errors.append(100.0 * (state.y - mm) / STROKE_MM)
    return float(np.sqrt(np.mean(np.square(errors))))


def test_adapted_rules_have_at_most_a_third_of_the_error_of_those_that_were_left_alone(ruled_bench):
    plant, in_force = ruled_bench.device.bench.plant, []
    ruled_bench.at(1.0, "arm")
    ruled_bench.at(4.0, "track", reference="sine")
    ruled_bench.at(20.0, "adapt", on=True)
    ruled_bench.do(60.0, lambda: plant.ageing.age_wire(shift_c=3.0, over_s=60.0 * MINUTES, fade=0.05))
    minutes_s = [60.0 * (1 + minute) for minute in range(1, MINUTES + 1)]
    for time_s in minutes_s:
        ruled_bench.do(time_s, lambda: in_force.append(ruled_bench.session.bench.in_force.model))
    ruled_bench.run(until_s=minutes_s[-1] + 1.0)
    assert ruled_bench.status["adapts"]
    assert all(model.certificate().holds for model in in_force)
    left_alone = rms_percent(ruled_bench.wire, [(time_s, ruled_bench.model) for time_s in minutes_s])
    adapted = rms_percent(ruled_bench.wire, list(zip(minutes_s, in_force, strict=True)))
    assert left_alone > 5.0
    assert adapted < left_alone / 3.0, (adapted, left_alone)
