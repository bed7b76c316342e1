"""The reading against the heat input: no healthy wire trips, and no faulty sensor hides a hot wire."""

from contextlib import nullcontext
from dataclasses import replace
from math import nan, sin

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from smadrive.errors import SafetyError
from smadrive.hysteresis import DuhemModel
from smadrive.measurement import Measurement
from smadrive.safety.displacement_band import DisplacementBand
from smadrive.safety.faults import Fault
from smadrive.safety.supervisor import Supervisor
from smadrive.safety.temperature_band import FROZEN_C, IDENTIFIED, NOMINAL, TemperatureBand
from smadrive.wire.data_sheet import load_data_sheet
from smadrive.wire.heat_balance import BalanceSource
from tests.unit.safety.limits import LIMITS

NOMINAL_BALANCE = load_data_sheet("flexinol-lt-0.15mm").heat_balance()
TICK_S = 0.05
FACTOR = st.floats(0.75, 1.33)
HOLDING, BURST = st.tuples(st.floats(0.0, 1.3), st.integers(1, 80)), st.tuples(st.floats(1.3, 6.0), st.integers(1, 6))
"""A power in W and its ticks: up to the power that holds the hottest wire, and the power of a large error."""


def loop(sigma):
    return DuhemModel.gaussian(
        mu_heating=90, mu_cooling=69, sigma_heating=sigma, sigma_cooling=sigma, scale=1, input_range=(-50, 400)
    )


LOOP = loop(sigma=5.0)


class Wire:
    """A wire with a thermocouple, whose phase follows a Duhem loop."""

    def __init__(self, balance, sigma=5.0):
        self.balance = balance
        self.loop = loop(sigma)
        self.temperature_c = self.reading_c = balance.ambient_c
        self.state = self.loop.initial_state(self.temperature_c)

    def heat(self, power_w):
        for _ in range(10):
            before_c = self.temperature_c
            direction = 1 if power_w > self.balance.loss_w_per_k * (before_c - self.balance.ambient_c) else -1
            slope = self.loop.slope(self.state, direction)
            self.temperature_c = self.balance.step(before_c, power_w, slope, TICK_S / 10)
            self.state = self.loop.step(self.state, self.temperature_c)
            self.reading_c = self.balance.step_thermocouple(self.reading_c, before_c, self.temperature_c, TICK_S / 10)
        return self.reading_c


def supervised(balance, uncertainty=NOMINAL, maximum_c=135.0, displacement_band=None, heated=None):
    lag_s = 3 * balance.thermocouple_lag_s
    limits = replace(LIMITS, temperature_max_c=maximum_c)
    return Supervisor(limits, TemperatureBand(balance, uncertainty, lag_s, heated), displacement_band)


def run(supervisor, wire, powers_w, read=lambda _n, reading_c: reading_c, sees=False, begin=0):
    """Heat the wire from tick `begin` on, and pass its reading through `read` to the supervisor.

    Return the trip or None. With `sees`, a sensor measures the displacement.
    """
    supervisor.check_may_arm(Measurement(begin * TICK_S, read(begin, wire.reading_c), 0.0, 0.0))
    for n, power_w in enumerate(powers_w, start=begin + 1):
        reading_c = read(n, wire.heat(power_w))
        seen_mm = wire.state.y if sees else nan
        sample = Measurement(n * TICK_S, reading_c, power_w, 1.0, seen_mm, in_force_a=power_w, armed=True)
        if trip := supervisor.update(sample, float("nan")):
            return trip
    return None


@pytest.mark.exhaustive
@settings(max_examples=40, deadline=None)
@given(
    capacity=FACTOR,
    loss=FACTOR,
    latent=FACTOR,
    sigma=st.floats(2.0, 8.0),
    lag_s=st.floats(0.0, 0.25),
    ambient_c=st.floats(15.0, 29.0),
    later_ambient_c=st.floats(15.0, 29.0),
    powers=st.lists(st.one_of(HOLDING, BURST), min_size=3, max_size=12),
    sees=st.booleans(),
    pause=st.integers(0, 60),
    uncertainty=st.sampled_from([NOMINAL, IDENTIFIED]),
)
def test_healthy_wire_of_any_allowed_parameters_does_not_trip(
    capacity, loss, latent, sigma, lag_s, ambient_c, later_ambient_c, powers, sees, pause, uncertainty
):
    """The powers hold a wire, with bursts far above. A second run begins after a pause, in another room."""
    true = replace(
        NOMINAL_BALANCE,
        heat_capacity_j_per_k=NOMINAL_BALANCE.heat_capacity_j_per_k * capacity,
        loss_w_per_k=NOMINAL_BALANCE.loss_w_per_k * loss,
        latent_heat_j=NOMINAL_BALANCE.latent_heat_j * latent,
        thermocouple_lag_s=lag_s,
        ambient_c=ambient_c,
    )
    steps = [power_w for power_w, ticks in powers for _ in range(ticks)]
    supervisor = supervised(NOMINAL_BALANCE, uncertainty, 600.0, DisplacementBand(LOOP))
    wire = Wire(true, sigma)
    assert run(supervisor, wire, steps, sees=sees) is None
    wire.balance = replace(true, ambient_c=later_ambient_c)
    for _ in range(pause):
        wire.heat(0.0)
    again = supervised(NOMINAL_BALANCE, uncertainty, 600.0, DisplacementBand(LOOP), supervisor.heated)
    assert run(again, wire, steps, sees=sees, begin=len(steps) + pause) is None


@pytest.mark.parametrize("pause", [1, 5])
def test_short_runs_heat_a_wire_with_a_loose_bead_no_further_than_one_run(pause):
    """Each run ends before its heat is seen. The next one must not forget it."""

    def read(n, _reading_c):
        return 22.0 + 0.01 * (n % 2)

    alone, wire = Wire(NOMINAL_BALANCE), Wire(NOMINAL_BALANCE)
    assert run(supervised(NOMINAL_BALANCE, IDENTIFIED), alone, [2.0] * 100, read).fault is Fault.READS_TOO_COLD
    heated, hottest_c = None, []
    for begin in range(0, 15 * 100, 15):
        supervisor = supervised(NOMINAL_BALANCE, IDENTIFIED, heated=heated)
        try:
            trip = run(supervisor, wire, [2.0] * (15 - pause), read, begin=begin)
        except SafetyError as refused:
            trip = refused
        hottest_c.append(wire.temperature_c)
        if trip is not None:
            break
        for _ in range(pause):
            wire.heat(0.0)
        heated = supervisor.heated
    assert trip is not None
    assert max(hottest_c) - 22.0 < 1.2 * (alone.temperature_c - 22.0)


@pytest.mark.parametrize(("on", "off"), [(5, 5), (10, 10), (10, 20)])
def test_pulses_trip_as_a_constant_power_does_with_a_loose_bead(on, off):
    """A wire warms up and cools down with one heat capacity, so it does not lose in a pause what a pulse gave."""

    def read(n, _reading_c):
        return 22.0 + 0.01 * (n % 2)

    alone, pulsed = Wire(NOMINAL_BALANCE), Wire(NOMINAL_BALANCE)
    assert run(supervised(NOMINAL_BALANCE), alone, [6.0] * 100, read).fault is Fault.READS_TOO_COLD
    powers_w = ([6.0] * on + [0.0] * off) * 20
    assert run(supervised(NOMINAL_BALANCE), pulsed, powers_w, read).fault is Fault.READS_TOO_COLD
    assert pulsed.temperature_c < alone.temperature_c + 60.0


def test_hot_wire_is_heated_again_at_once():
    """The power that holds the wire is no rise that the reading would have to follow."""
    balance = replace(
        NOMINAL_BALANCE,
        heat_capacity_j_per_k=0.75 * NOMINAL_BALANCE.heat_capacity_j_per_k,
        loss_w_per_k=1.3125 * NOMINAL_BALANCE.loss_w_per_k,
        latent_heat_j=0.75 * NOMINAL_BALANCE.latent_heat_j,
        thermocouple_lag_s=0.0,
        ambient_c=15.0,
    )
    wire, heated, powers_w = Wire(balance, 2.0), None, [3.0] * 5 + [1.25] * 12 + [6.0] * 6
    for begin in (0, len(powers_w)):
        supervisor = supervised(NOMINAL_BALANCE, NOMINAL, 600.0, DisplacementBand(LOOP), heated)
        assert run(supervisor, wire, powers_w, sees=True, begin=begin) is None
        heated = supervisor.heated


def test_wire_is_armed_again_when_the_heat_of_its_last_run_is_gone():
    """The reading of the loose bead is right after the wire has cooled."""
    wire = Wire(NOMINAL_BALANCE)
    supervisor = supervised(NOMINAL_BALANCE, IDENTIFIED)
    run(supervisor, wire, [2.0] * 100, lambda n, _c: 22.0 + 0.01 * (n % 2))
    for after_s, is_refused in ((0.1, True), (20.0, False)):
        rest = Measurement(supervisor.heated.time_s + after_s, 22.0, 0.0, 0.0)
        again = supervised(NOMINAL_BALANCE, IDENTIFIED, heated=supervisor.heated)
        with pytest.raises(SafetyError) if is_refused else nullcontext():
            again.check_may_arm(rest)


@pytest.mark.parametrize("uncertainty", [NOMINAL, IDENTIFIED])
def test_warmer_room_takes_up_no_latent_heat(uncertainty):
    """The wire has rested in a cold room after a run, and a second run begins in a warmer room."""
    last = TemperatureBand(NOMINAL_BALANCE, uncertainty, 0.2)
    last.start(12.0, 0.0)
    for n, power_w in enumerate([2.0] * 40 + [0.0] * 1200, start=1):
        last.update(12.0, power_w, n * TICK_S)
    lows_c = []
    for heated in (last.heated, None):
        band, begin_s = TemperatureBand(NOMINAL_BALANCE, uncertainty, 0.2, heated), 3600.0
        band.start(22.0, begin_s)
        lows_c += [band.update(22.0, 2.0, begin_s + n * TICK_S).low_c for n in range(1, 41)][-1:]
    assert lows_c[0] == pytest.approx(lows_c[1], abs=0.1)


def test_loose_bead_on_a_transformed_wire_trips_sooner_with_its_displacement():
    """The wire is cold by its heat input alone, because its current was zero for some time."""

    def hottest_c(sees):
        wire = Wire(NOMINAL_BALANCE)
        supervisor = supervised(NOMINAL_BALANCE, IDENTIFIED, 135.0, DisplacementBand(LOOP))
        powers_w = [1.2] * 120 + [0.0] * 20 + [2.5] * 200
        trip = run(supervisor, wire, powers_w, lambda n, c: c if n < 140 else 0.5 * (c + 22.0), sees)
        assert trip.fault in (Fault.READS_TOO_COLD, Fault.OVER_TEMPERATURE)
        return wire.temperature_c

    assert hottest_c(sees=True) < 0.8 * hottest_c(sees=False)


@pytest.mark.parametrize("uncertainty", [NOMINAL, IDENTIFIED])
@pytest.mark.parametrize(
    ("read", "fault"),
    [
        (lambda n, _c: 22.0 + 0.01 * (n % 2), Fault.READS_TOO_COLD),
        (lambda _n, c: 44.0 - c, Fault.READS_TOO_COLD),
        (lambda n, c: c + 0.4 * n, Fault.READS_TOO_HOT),
    ],
    ids=["fell off", "reversed", "drifting up"],
)
def test_wrong_reading_trips(read, fault, uncertainty):
    powers_w = [1.0] * 100 + [0.0] * 400
    trip = run(supervised(NOMINAL_BALANCE, uncertainty, 400.0), Wire(NOMINAL_BALANCE), powers_w, read)
    assert trip is not None
    assert trip.fault is fault


@pytest.mark.parametrize("uncertainty", [NOMINAL, IDENTIFIED])
def test_frozen_reading_trips_before_the_wire_is_too_hot(uncertainty):
    """The reading freezes while the rig heats with its full power: 6 W, about 100 K/s."""
    wire, frozen_c = Wire(NOMINAL_BALANCE), []

    def read(n, reading_c):
        if n >= 40:
            frozen_c.append(reading_c)
        return frozen_c[0] if frozen_c else reading_c

    trip = run(supervised(NOMINAL_BALANCE, uncertainty), wire, [0.7] * 40 + [6.0] * 100, read)
    assert trip.fault is Fault.SENSOR_FROZEN
    assert wire.temperature_c < 130.0


def test_missing_readings_do_not_hide_a_frozen_reading():
    band = TemperatureBand(NOMINAL_BALANCE, NOMINAL, 0.3)
    band.start(60.0, 0.0)
    unseen_c = [band.update(nan if n % 5 == 0 else 60.0, 3.0, n * TICK_S).unseen_c for n in range(1, 60)]
    assert max(unseen_c) > FROZEN_C


def test_coarse_reading_that_last_changed_in_a_pulse_of_power_is_not_frozen():
    """At the last change the power was high, because the wire was colder a moment before. A recorded run at 4 Hz."""
    balance = replace(NOMINAL_BALANCE, source=BalanceSource.IDENTIFIED)
    band, unseen_c = TemperatureBand(balance, IDENTIFIED, 0.5), []
    held_w = balance.power_w(79.0, 0.0, 0.0)
    shares = [1.0] * 20 + [0.12, 0.95, 1.25] + [1.0, 0.75, 1.0, 0.95, 1.0, 0.95]
    readings_c = [83.0 + n % 2 for n in range(20)] + [80.0, 77.0] + [78.0] * 7
    band.start(83.0, 0.0)
    for n, (share, reading_c) in enumerate(zip(shares, readings_c, strict=True), start=1):
        unseen_c.append(band.update(reading_c, share * held_w, 0.3 * n).unseen_c)
    assert max(unseen_c) < FROZEN_C


def test_wire_that_must_be_too_hot_trips_at_any_reading():
    wire = Wire(NOMINAL_BALANCE)
    trip = run(supervised(NOMINAL_BALANCE, IDENTIFIED), wire, [2.5] * 200, lambda n, c: c if n < 10 else 70 + sin(n))
    assert trip.fault in (Fault.OVER_TEMPERATURE, Fault.READS_TOO_COLD)
    assert wire.temperature_c < 220.0


@pytest.mark.parametrize("gap", [range(0), range(150, 152)])
def test_reading_that_hardly_follows_strong_heat_trips_soon(gap):
    """The bead leaves a wire that is held at 95 °C, its reading creeps, and the controller heats with a burst."""
    wire = Wire(NOMINAL_BALANCE)
    supervisor = supervised(NOMINAL_BALANCE, IDENTIFIED, 400.0)

    def read(n, reading_c):
        return nan if n in gap else reading_c if n <= 140 else 94.0 + 0.2 * (n - 140)

    trip = run(supervisor, wire, [0.9] * 140 + [4.5] * 60, read)
    assert trip.fault is Fault.READS_TOO_COLD
    assert wire.temperature_c < 200.0


def test_unmeasured_heat_trips():
    wire = Wire(NOMINAL_BALANCE)
    trip = run(supervised(NOMINAL_BALANCE), wire, [0.0] * 200, lambda _n, _c: wire.heat(2.0))
    assert trip.fault is Fault.READS_TOO_HOT
