"""The gripper on a simulated wire, in virtual time."""

import pytest
from gripper import Hold, grip

import smadrive
from smadrive.errors import TripError


@pytest.fixture(scope="session")
def wire(tmp_path_factory):
    with smadrive.open_rig("in-process") as rig:
        return smadrive.identify(rig.excite(tmp_path_factory.mktemp("logs") / "excitation.h5"))


def test_finger_reaches_its_position(wire, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run = grip("in-process", wire)
    assert run.trips == 0
    assert run["displacement_mm"][-1] == pytest.approx(5.0, abs=0.2)


def test_broken_thermocouple_opens_the_gripper(wire, sma_rig, sma_faults):
    def break_it(tick):
        if tick.time_s > 2.0:
            sma_faults.open_thermocouple()

    with pytest.raises(TripError):
        sma_rig.drive(Hold(5.0, duration_s=20.0), wire.heat_balance, break_it)
    assert sma_faults.bench.plant.current_a == 0.0


@pytest.mark.sma(seed=3)
def test_cold_wire_is_at_rest(sma_rig):
    assert sma_rig.measure().displacement_mm == pytest.approx(0.0, abs=0.1)
