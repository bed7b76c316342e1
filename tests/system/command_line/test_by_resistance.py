"""`run --displacement-from resistance`: the run, its log and its replay; and the requests that are refused."""

import json
from contextlib import contextmanager, nullcontext
from dataclasses import replace

import numpy as np
import pytest
from marks import exhaustive

from firmware_sim.bench import simulated_device
from firmware_sim.config import load_sim
from smadrive.clock import VirtualClock
from smadrive.control.controllers.source_events import BY_RESISTANCE, RESISTANCE_WRONG
from smadrive.errors import ConfigError
from smadrive.hysteresis import DuhemModel
from smadrive.measurement import DisplacementFrom
from smadrive.rig.config import load_rig
from smadrive.rig.rig import Rig
from smadrive.runs.experiments import read_reference, track
from smadrive.runs.log.reader import read_log
from smadrive.runs.metrics.tracking_error import error_percent
from smadrive.runs.replay import replay
from smadrive.runs.tracking_plan import plan_tracking
from smadrive.wire.heat_balance import HeatBalance
from smadrive.wire.identified_resistance import WireResistance
from smadrive.wire.identified_wire import IdentifiedWire

MODEL = DuhemModel.gaussian(
    mu_heating=89.9, mu_cooling=69.0, sigma_heating=5, sigma_cooling=5, scale=12, input_range=(0, 200)
)
BALANCE = HeatBalance(0.0298, 0.014, 0.8276, 22.0, 16.5, -0.12, 0.15)
RESISTANCE = WireResistance(22.0, 16.5, 0.0, 0.0, 0.004, 0.001, 0.01, (20.0, 80.0, 140.0), (14.52,) * 3)
WIRE = IdentifiedWire(MODEL, BALANCE, resistance=RESISTANCE)
REFERENCE = "sine:low_mm=3,high_mm=8,period_s=20,cycles=1"


def recorded(log_file, chosen, at_tick=lambda _bench, _tick: None, reference=REFERENCE):
    device = simulated_device(load_sim("flexinol-lt-0.15mm"), seed=4)
    clock = VirtualClock()
    clock.follow(device.bench.advance_to)
    with Rig(load_rig("in-process"), transports={"board": device.transport(clock)}) as rig:
        plan = plan_tracking(
            rig, read_reference(reference), WIRE, smooth=True, smooth_option="--smooth", displacement_from=chosen
        )

        @contextmanager
        def watch(recorder, _duration_s):
            def record(tick):
                at_tick(device.bench, tick)
                recorder.tick(tick)

            yield record

        track(log_file, rig, plan, watch)
    return read_log(log_file)


@pytest.mark.exhaustive
def test_run_by_resistance_is_recorded_and_replayed(tmp_path):
    log = recorded(tmp_path / "run.h5", DisplacementFrom.RESISTANCE)
    assert log.metadata["displacement_from"] == "resistance"
    late = log.column("time_s") > 12.0
    assert log.column("uses_resistance")[late].all()
    error = (log.column("setpoint_mm") - log.column("displacement_mm"))[late] / 12.0
    assert np.sqrt(np.mean(error**2)) < 0.01
    assert replay(log).exact
    assert not any(BY_RESISTANCE in event.message for event in log.events)


def test_slipped_sensor_is_replaced_with_a_warning(tmp_path):
    def slip(bench, tick):
        if 18.0 < tick.time_s < 18.1:
            bench.sensors.faults.slip_displacement(1.5)

    log = recorded(tmp_path / "run.h5", DisplacementFrom.SENSOR, slip)
    (event,) = [event for event in log.events if event.message == BY_RESISTANCE]
    assert 18.0 < event.time_s < 19.0
    late = log.column("time_s") > 20.0
    error_mm = log.column("setpoint_mm") - (log.column("displacement_mm") - 1.5)
    assert np.abs(error_mm[late]).max() < 0.02 * 12.0
    assert np.isnan(error_percent(log)[late]).all()
    assert replay(log).exact


@pytest.mark.exhaustive
def test_run_goes_on_by_resistance_although_the_stuck_sensor_becomes_impossible(tmp_path):
    """The sensor shows the displacement of a hot wire while the wire is cold. It was found to be wrong before."""

    def stick(bench, tick):
        if 40.0 < tick.time_s < 40.1:
            bench.sensors.faults.stick_displacement()

    reference = "sine:low_mm=0.01,high_mm=8,period_s=60,cycles=1"
    log = recorded(tmp_path / "run.h5", DisplacementFrom.SENSOR, stick, reference)
    assert log.column("time_s")[-1] > 69.0
    assert log.column("temperature_c")[-1] < 62.0
    assert log.column("displacement_mm")[-1] > 7.0


def test_wire_without_resistance_is_refused(tmp_path):
    with Rig(load_rig("in-process")) as rig, pytest.raises(ConfigError) as raised:
        plan_tracking(
            rig,
            read_reference(REFERENCE),
            replace(WIRE, resistance=None),
            smooth=True,
            smooth_option="--smooth",
            displacement_from=DisplacementFrom.RESISTANCE,
        )
    assert raised.value.where == "displacement_from"


@pytest.mark.parametrize("chosen", [exhaustive(None), DisplacementFrom.SENSOR])
def test_sensor_that_the_rig_lacks_is_refused_only_if_the_user_chooses_it(chosen):
    config = load_rig("in-process")
    devices = [device.model_copy(update={"measures": ["temperature"]}) for device in config.devices]
    options = {"smooth": True, "smooth_option": "--smooth", "displacement_from": chosen}
    with (
        Rig(config.model_copy(update={"devices": devices})) as rig,
        nullcontext() if chosen is None else pytest.raises(ConfigError) as raised,
    ):
        plan_tracking(rig, read_reference(REFERENCE), WIRE, **options)
    assert chosen is None or raised.value.where == "displacement_from"


def test_source_in_the_rig_file_is_the_default():
    config = load_rig("in-process").model_copy(update={"displacement_from": DisplacementFrom.NONE})
    with Rig(config) as rig:
        plan = plan_tracking(rig, read_reference(REFERENCE), WIRE, smooth=True, smooth_option="--smooth")
    assert plan.displacement_from is DisplacementFrom.NONE
    assert json.loads(config.model_dump_json())["displacement_from"] == "none"


def test_contact_that_changes_is_told_as_a_wrong_resistance(tmp_path):
    def corrode(bench, tick):
        if 18.0 < tick.time_s < 18.1:
            bench.plant.faults.corrode_contact(1.0)

    log = recorded(tmp_path / "run.h5", DisplacementFrom.SENSOR, corrode)
    (event,) = [event for event in log.events if event.message == RESISTANCE_WRONG]
    assert 18.0 < event.time_s < 22.0
    assert not log.column("sensor_replaced").any()
    assert np.array_equal(log.column("resistance_wrong") > 0.0, log.column("time_s") >= event.time_s)
