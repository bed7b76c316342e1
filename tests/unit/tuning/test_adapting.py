"""What is left in force when the adaptation ends."""

import pytest


def test_when_its_sensor_is_found_lying_the_rules_of_well_before_are_put_in_force(ruled_bench):
    """A thermocouple that drifts is followed for a while: what was learnt by then must not stay."""
    faults, spoilt = ruled_bench.device.bench.sensors.faults, []
    ruled_bench.at(1.0, "arm")
    ruled_bench.at(1.2, "adapt", on=True)
    ruled_bench.at(1.5, "track", reference="sine")
    ruled_bench.do(50.0, lambda: faults.thermocouple.begin("drift", None, lambda r, age_s: r.right + 0.05 * age_s))
    ruled_bench.do(75.0, lambda: spoilt.append(ruled_bench.session.bench.in_force.model))
    ruled_bench.do(75.0, lambda: faults.displacement.begin("stuck", None, lambda r, age_s: r.shown))
    ruled_bench.run(until_s=90.0)
    (ended_s, told) = next(entry for entry in ruled_bench.status["events"] if "adaptation ended" in entry[1])
    assert ended_s < 85.0
    assert "its rules of well before are put in force" in told
    in_force = ruled_bench.session.bench.in_force
    assert in_force.change == "adaptation"
    assert in_force.model.scale != pytest.approx(spoilt[0].scale, rel=1e-3), "what was learnt by the lie is in force"
    assert not ruled_bench.status["adapts"]
