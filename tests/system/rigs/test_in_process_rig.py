"""The whole driver with the simulated device in one process and in virtual time: excite, identify, track, trip."""

from math import isfinite, isnan

import numpy as np
import pytest
from exact_wire import exact_wire
from marks import exhaustive

from firmware_sim.bench import simulated_device
from firmware_sim.config import load_sim
from smadrive.clock import VirtualClock
from smadrive.control.feedforward.displacement import HysteresisInverse
from smadrive.control.feedforward.static_map import StaticMap
from smadrive.control.references.shapes import sine
from smadrive.errors import SafetyError, TripError
from smadrive.rig.config import load_rig
from smadrive.rig.rig import Rig
from smadrive.runs.log.reader import read_log
from smadrive.runs.metrics.run import tracking_metrics
from smadrive.runs.run_log import record_excitation, record_tracking
from smadrive.safety.faults import CLEAR, Fault
from smadrive.wire.wire_model import WireModel, travel_mm


class Bench:
    """The shipped in-process rig, with access to its simulated device."""

    def __init__(self):
        self.device = simulated_device(load_sim("flexinol-lt-0.15mm"), seed=3)
        self.clock = VirtualClock()
        self.clock.follow(self.device.bench.advance_to)
        self.rig = Rig(load_rig("in-process"), transports={"board": self.device.transport(self.clock)})


@pytest.fixture
def bench():
    return Bench()


def test_displacement_of_a_board_without_a_sensor_is_unknown(bench):
    config = load_rig("in-process")
    board = config.devices[0].model_copy(update={"measures": ("temperature",)})
    alone = Rig(
        config.model_copy(update={"devices": (board,)}), transports={"board": bench.device.transport(bench.clock)}
    )
    with bench.rig as rig:
        assert isfinite(rig.measure().displacement_mm)
    with alone as rig:
        measured = rig.measure()
    assert isfinite(measured.temperature_c)
    assert isnan(measured.displacement_mm)


@pytest.fixture
def excited(identified):
    """Return the log of one excitation, and the wire that is identified from this log."""
    return identified.log, identified.wire


@pytest.mark.exhaustive
def test_identification_recovers_the_simulated_wire_from_its_record(excited):
    _, wire = excited
    sim = load_sim("flexinol-lt-0.15mm").wire
    balance = wire.thermal.balance
    assert balance.heat_capacity_j_per_k == pytest.approx(sim.heat_capacity_j_per_k, rel=0.03)
    assert balance.loss_w_per_k == pytest.approx(sim.loss_w_per_k, rel=0.02)
    assert balance.latent_heat_j == pytest.approx(sim.mass_kg * sim.latent_heat_j_per_kg, rel=0.05)
    assert balance.resistance_change == pytest.approx(sim.resistance_change, abs=0.01)
    assert wire.hysteresis.rms_percent < 0.5
    assert wire.hysteresis.certificate.holds
    assert len(wire.hysteresis.model.rules) == 22


@pytest.mark.exhaustive
def test_the_inverse_tracks_ten_times_better_than_the_plain_map(excited, tmp_path):
    log, wire = excited
    model, balance = wire.hysteresis.model, wire.thermal.balance
    cold_mm, hot_mm = travel_mm(model)
    low_mm, high_mm = (cold_mm + part * (hot_mm - cold_mm) for part in (0.2, 0.8))
    reference = sine(low_mm=low_mm, high_mm=high_mm, period_s=56.0, cycles=1.5).with_approach(cold_mm, 10.0)
    plain = StaticMap(wire.thermal.wire_temperature_c, log.column("displacement_mm"))
    errors = []
    for name, inverse in (("inverse", HysteresisInverse(model)), ("plain", plain)):
        path = tmp_path / f"{name}.h5"
        experiment = reference, WireModel(model, balance), inverse
        with Rig(load_rig("in-process")) as rig, record_tracking(path, rig, *experiment) as recorder:
            loop = rig.track(*experiment, recorder.tick)
        figures = tracking_metrics(read_log(path), loop)
        assert figures.missed_deadlines == figures.trips == 0
        errors.append(figures.rms_percent)
    assert errors[0] <= 2.0
    assert errors[0] <= errors[1] / 10


def assert_same_log(first, second):
    one, other = read_log(first), read_log(second)
    assert one.events == other.events
    for name, column in one.columns.items():
        np.testing.assert_array_equal(column, other.columns[name], err_msg=name)


@pytest.mark.exhaustive
def test_the_same_tracking_twice_gives_the_same_log(excited, tmp_path):
    _, wire = excited
    model = wire.hysteresis.model
    cold_mm, _ = travel_mm(model)
    reference = sine(low_mm=3.0, high_mm=8.0, period_s=28.0, cycles=1.0).with_approach(cold_mm, 5.0)
    paths = tmp_path / "first.h5", tmp_path / "second.h5"
    for path in paths:
        experiment = reference, WireModel(model, wire.thermal.balance), HysteresisInverse(model)
        with Rig(load_rig("in-process")) as rig, record_tracking(path, rig, *experiment) as recorder:
            assert rig.track(*experiment, recorder.tick).ticks > 600
    assert_same_log(*paths)


@pytest.mark.exhaustive
def test_the_same_excitation_twice_gives_the_same_log(tmp_path):
    paths = tmp_path / "first.h5", tmp_path / "second.h5"
    for path in paths:
        with Rig(load_rig("in-process")) as rig, record_excitation(path, rig, rig.excitation(22.0)) as recorder:
            ticks = iter(range(600))

            def record(tick, recorder=recorder, ticks=ticks):
                recorder.tick(tick)
                if next(ticks, None) is None:
                    raise KeyboardInterrupt

            with pytest.raises(KeyboardInterrupt):
                rig.excite(rig.excitation(22.0), record)
    assert_same_log(*paths)


def excite_and_break(bench, break_it):
    """Excite the wire, break something after two seconds, and return the trip."""
    count = iter(range(10_000))

    def record(tick):
        if next(count) == 40:
            assert bench.device.firmware.current_a > 0
            break_it()

    with pytest.raises(TripError) as caught, bench.rig as rig:
        rig.excite(rig.excitation(22.0), record)
    return caught.value


def test_an_open_thermocouple_trips_and_ends_with_zero_current(bench):
    trip = excite_and_break(bench, bench.device.bench.sensors.faults.open_thermocouple)
    assert trip.number == Fault.DEVICE_FAULT.number
    assert bench.device.firmware.current_a == 0.0
    assert getattr(trip, "__notes__", []) == []


@pytest.mark.parametrize("at_s", [0.0, exhaustive(30.0), exhaustive(45.0)])
def test_displacement_that_stands_still_while_the_wire_moves_trips(bench, at_s):
    stick = bench.device.bench.known_faults()["stick_displacement"]
    with pytest.raises(TripError) as caught, bench.rig as rig:
        track(rig, lambda tick: stick() if at_s <= tick.time_s < at_s + 0.05 else None)
    assert caught.value.number == Fault.DISPLACEMENT_IMPLAUSIBLE.number
    assert bench.device.bench.plant.current_a == 0.0
    assert bench.device.bench.plant.temperature_c < 110.0


@pytest.mark.exhaustive
def test_a_displacement_that_spikes_now_and_then_does_not_trip(bench):
    bench.device.bench.known_faults()["spike_displacement"](height_mm=50.0)
    with bench.rig as rig:
        assert track(rig, lambda _: None).trips == 0


def track(rig, record):
    """Track a sine with the exact wire."""
    wire = exact_wire().wire_model(rig.nominal_balance)
    reference = sine(low_mm=2.0, high_mm=9.0, period_s=56.0, cycles=1).with_approach(travel_mm(wire.model)[0], 10.0)
    return rig.track(reference, wire, HysteresisInverse(wire.model), record)


def test_dead_bus_trips_unconfirmed_and_the_watchdog_switches_off(bench):
    trip = excite_and_break(bench, lambda: bench.device.faults.drop(10_000))
    assert trip.number == Fault.STALE_DATA.number
    assert sum("could NOT be confirmed off" in note for note in trip.__notes__) == 1
    assert bench.device.firmware.current_a == 0.0
    assert any("watchdog" in event for event in bench.device.bench.events)


def test_an_exception_in_the_loop_ends_with_zero_current(bench):
    def record(tick):
        if tick.time_s > 2.0:
            assert bench.device.firmware.current_a > 0
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError), bench.rig as rig:
        rig.excite(rig.excitation(22.0), record)
    assert bench.device.firmware.current_a == 0.0


def test_a_latched_fault_refuses_to_heat_until_it_is_cleared(bench):
    bench.device.bench.sensors.faults.open_thermocouple()
    with bench.rig as rig:
        with pytest.raises(SafetyError, match="thermocouple_open"):
            rig.excite(rig.excitation(22.0), lambda tick: None)
        bench.device.bench.sensors.faults.mend_thermocouple()
        with pytest.raises(SafetyError) as refused:
            rig.excite(rig.excitation(22.0), lambda tick: None)
        assert refused.value.cure == CLEAR
        rig.heater.clear_faults()
        assert rig.heater.exchange(0.0).device_faults == ()
