"""The adaptation follows a wire that ages while it works, from the registers of the device to the rules in force."""

import pytest

MINUTES = 6


@pytest.mark.exhaustive
def test_adapted_rules_have_at_most_a_third_of_the_error_of_unadapted_ones(ruled_rig):
    plant, in_force = ruled_rig.device.bench.plant, []
    ruled_rig.at(1.0, "arm")
    ruled_rig.at(4.0, "track", reference="sine")
    ruled_rig.at(20.0, "adapt", on=True)
    ruled_rig.do(60.0, lambda: plant.ageing.age_wire(shift_c=3.0, over_s=60.0 * MINUTES, fade=0.05))
    minutes_s = [60.0 * (1 + minute) for minute in range(1, MINUTES + 1)]
    for time_s in minutes_s:
        ruled_rig.do(time_s, lambda: in_force.append(ruled_rig.session.tunings.in_force.model))
    ruled_rig.run(until_s=minutes_s[-1] + 1.0)
    assert ruled_rig.status["adapts"]
    assert all(model.certificate().holds for model in in_force)
    left_alone = ruled_rig.rms_percent([(time_s, ruled_rig.model) for time_s in minutes_s])
    adapted = ruled_rig.rms_percent(list(zip(minutes_s, in_force, strict=True)))
    assert left_alone > 5.0
    assert adapted < left_alone / 3.0, (adapted, left_alone)
