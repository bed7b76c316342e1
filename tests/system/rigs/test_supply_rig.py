"""A rig with a bench supply, a thermometer and a laser on one simulated wire, in virtual time."""

import pytest

from firmware_sim.bench import SimulatedBench
from firmware_sim.config import load_sim
from smadrive.clock import VirtualClock
from smadrive.control.feedforward.displacement import HysteresisInverse
from smadrive.control.references.shapes import sine
from smadrive.devices.identity import TypeCheck
from smadrive.devices.profile.profile import load_profile
from smadrive.errors import ConfigError, DeadlineError, IdentityError, TripError
from smadrive.identification.wire import identify_wire
from smadrive.modbus.transports.in_process import InProcessTransport
from smadrive.rig.config import RigConfig, load_rig
from smadrive.rig.rig import Rig
from smadrive.runs.log.reader import read_log
from smadrive.runs.metrics.run import tracking_metrics
from smadrive.runs.run_log import record_excitation, record_tracking
from smadrive.runs.run_metadata import excitation_record, nominal_balance
from smadrive.safety.faults import Fault
from smadrive.wire.wire_model import WireModel, travel_mm

PROFILES = {"supply": "riden-rd60xx", "reader": "autonics-tk", "laser": "baumer-om20"}


def rig_of(devices, rate_hz=4.0, **limits):
    """Return the shipped in-process rig with other devices."""
    base = load_rig("in-process").model_dump(exclude_none=True, exclude={"feedback"})
    base["devices"] = devices
    base["rate_hz"] = rate_hz
    base["limits"] |= {"current_max_a": 0.4, "voltage_max_v": 15.0, "watchdog_s": 1.0, "stale_after_s": 2.0} | limits
    return RigConfig.model_validate(base)


def devices(**changes):
    return [
        {"name": name, "profile": profile, "url": "sim://flexinol-lt-0.15mm"} | changes.get(name, {})
        for name, profile in PROFILES.items()
    ]


class Plug:
    """The far end of a port, which can be connected to another device."""

    def __init__(self, device):
        self.device = device

    def receive(self, data, time_s):
        return self.device.line.receive(data, time_s)


class Bench:
    """The rig, with access to its simulated bench."""

    def __init__(self, config):
        self.bench = SimulatedBench(load_sim("flexinol-lt-0.15mm"), seed=3)
        clock = VirtualClock()
        clock.follow(self.bench.advance_to)
        self.devices = {name: self.bench.attach(load_profile(profile), name=name) for name, profile in PROFILES.items()}
        self.transports = {name: device.transport(clock) for name, device in self.devices.items()}
        self.rig = Rig(config, transports=self.transports)

    def heat(self, rig, current_a, ticks):
        measured = []
        for _ in range(ticks):
            rig.clock.sleep_until(rig.clock.now_s() + 0.25)
            measured.append(rig.heater.exchange(current_a))
        return measured


@pytest.fixture
def bench():
    return Bench(rig_of(devices()))


def test_every_device_is_known_and_measures_its_part(bench):
    with bench.rig as rig:
        assert list(rig.identities) == ["supply", "reader", "laser"]
        assert {name: identity.check for name, identity in rig.identities.items()} == {
            "supply": TypeCheck.PROVED,
            "reader": TypeCheck.ANSWERED,
            "laser": TypeCheck.ANSWERED,
        }
        rig.heater.arm(1.0)
        last = bench.heat(rig, 0.25, 60)[-1]
        plant = bench.bench.plant
        assert last.armed
        assert last.current_a == pytest.approx(0.25, abs=0.002)
        assert last.voltage_v == pytest.approx(0.25 * plant.resistance_ohm, abs=0.02)
        assert last.temperature_c == pytest.approx(plant.temperature_c, abs=1.5)
        assert last.displacement_mm == pytest.approx(plant.displacement_mm, abs=0.2)
        assert 0.0 <= last.temperature_age_s <= 0.5
    assert bench.devices["supply"].firmware.current_a == 0.0


def test_unasked_device_is_not_reported_as_answering(bench):
    bench = Bench(rig_of(devices(laser={"measures": []})))
    with bench.rig as rig:
        assert rig.identities["laser"].check is TypeCheck.NOT_ASKED
        assert rig.identify()["laser"].check is TypeCheck.ANSWERED


def test_an_unused_device_that_is_silent_is_found_by_asking_every_device(bench):
    bench = Bench(rig_of(devices(laser={"measures": []})))
    bench.devices["laser"].faults.drop(1_000_000)
    with bench.rig as rig, pytest.raises(DeadlineError):
        rig.identify()


@pytest.mark.parametrize("code", [1, 2, 4, 6])
def test_exception_reply_of_a_sensor_keeps_its_last_reading(bench, code):
    with bench.rig as rig:
        rig.heater.arm(1.0)
        (before,) = bench.heat(rig, 0.25, 1)
        bench.devices["reader"].faults.refuse(code, replies=1)
        after = bench.heat(rig, 0.25, 2)
        assert after[0].temperature_c == before.temperature_c
        assert after[0].temperature_age_s > before.temperature_age_s
        assert [one.armed for one in after] == [True, True]
        bench.devices["reader"].faults.refuse(code, for_s=10.0)
        assert "no new temperature" in bench.heat(rig, 0.25, 12)[-1].temperature_fault


def test_supply_gets_only_changed_settings_and_is_read_back_each_time(bench):
    with bench.rig as rig:
        rig.heater.arm(1.0)
        bench.heat(rig, 0.25, 2)
        counters = rig.devices["supply"].client.counters
        before = counters.requests
        bench.heat(rig, 0.25, 4)
        assert counters.requests == before + 4
        bench.heat(rig, 0.26, 1)
        assert counters.requests == before + 6


def test_measurement_belongs_to_the_previous_command(bench):
    with bench.rig as rig:
        rig.heater.arm(1.0)
        bench.heat(rig, 0.25, 2)
        (after,) = bench.heat(rig, 0.1, 1)
        assert (after.in_force_a, after.current_a) == pytest.approx((0.25, 0.25), abs=0.002)
        (after,) = bench.heat(rig, 0.0, 1)
        assert (after.in_force_a, after.current_a) == pytest.approx((0.1, 0.1), abs=0.002)


@pytest.mark.exhaustive
def test_wire_on_a_supply_is_identified_and_tracked_from_cold(tmp_path):
    path, run = tmp_path / "excitation.h5", tmp_path / "run.h5"
    bench_supply = load_rig("bench-supply").at("sim://flexinol-lt-0.15mm")
    with Rig(bench_supply) as rig:
        excitation = rig.excitation(22.0)
        with record_excitation(path, rig, excitation) as recorder:
            rig.excite(excitation, recorder.tick)
    log = read_log(path)
    found = identify_wire(excitation_record(log), nominal_balance(log))
    model, balance = found.hysteresis.model, found.thermal.balance
    wire = load_sim("flexinol-lt-0.15mm")
    assert balance.thermocouple_lag_s == pytest.approx(wire.thermocouple.lag_s, abs=0.05)
    assert balance.heat_capacity_j_per_k == pytest.approx(wire.wire.heat_capacity_j_per_k, rel=0.05)
    reference = sine(low_mm=2.0, high_mm=9.0, period_s=56.0, cycles=1.5).with_approach(travel_mm(model)[0], 10.0)
    experiment = reference, WireModel(model, balance), HysteresisInverse(model)
    with Rig(bench_supply) as rig, record_tracking(run, rig, *experiment) as recorder:
        loop = rig.track(*experiment, recorder.tick)
    tracked = read_log(run)
    assert tracking_metrics(tracked, loop).rms_percent < 0.5
    ahead_mm = tracked.column("displacement_mm") - tracked.column("setpoint_mm")
    assert ahead_mm[tracked.column("time_s") < 10.0].max() < 0.5


@pytest.mark.parametrize(
    ("name", "turned"), [("i_set", {"heater_current": 0.55}), ("v_set", {"heater_voltage": 16.0, "ovp": 60.0})]
)
def test_turned_knob_trips(bench, name, turned):
    def record(tick):
        if tick.time_s > 5.0:
            bench.devices["supply"].firmware.write(turned)

    with pytest.raises(TripError, match=f"'{name}'.* knob") as caught, bench.rig as rig:
        rig.excite(rig.excitation(22.0), record)
    assert caught.value.number == Fault.COMMAND_REFUSED.number
    assert bench.devices["supply"].firmware.current_a == 0.0


def test_dead_thermometer_stops_the_heat_although_the_supply_works(bench):
    def record(tick):
        if tick.time_s > 5.0:
            bench.devices["reader"].faults.drop(for_s=1000.0)

    with pytest.raises(TripError) as caught, bench.rig as rig:
        rig.excite(rig.excitation(22.0), record)
    assert caught.value.number == Fault.SENSOR_INVALID.number
    assert "no new temperature for" in str(caught.value)
    assert bench.devices["supply"].firmware.current_a == 0.0


def test_a_supply_that_lost_its_output_is_noticed(bench):
    def record(tick):
        if tick.time_s > 5.0:
            bench.devices["supply"].firmware.write({"heater_enable": 0})

    with pytest.raises(TripError) as caught, bench.rig as rig:
        rig.excite(rig.excitation(22.0), record)
    assert caught.value.number == Fault.DISARMED.number


def test_an_output_that_blinks_between_two_exchanges_is_noticed(bench):
    """Otherwise the driver, which is no longer armed, would continue the run without current."""
    supply = bench.devices["supply"].firmware
    blinked = []

    def record(tick):
        if blinked == ["off"]:
            supply.write({"heater_enable": 1})
            blinked.append("on")
        if tick.time_s > 5.0 and not blinked:
            supply.write({"heater_enable": 0})
            blinked.append("off")

    with pytest.raises(TripError) as caught, bench.rig as rig:
        rig.excite(rig.excitation(22.0), record)
    assert caught.value.number == Fault.DISARMED.number
    assert not supply.on


@pytest.mark.parametrize("rate_hz", [8.0, 20.0])
def test_rate_above_that_of_the_devices_is_rejected_with_a_possible_rate(rate_hz):
    """The supply answers at most ten requests per second, and a changed current needs two."""
    bench = Bench(rig_of(devices(), rate_hz=rate_hz))
    with pytest.raises(ConfigError, match="rate_hz") as caught, bench.rig as rig:
        rig.excite(rig.excitation(22.0), lambda tick: None)
    assert caught.value.value.startswith("0.2")
    assert caught.value.limit == f"{1.0 / rate_hz:g} s"


def test_unused_second_thermometer_is_allowed():
    both = [*devices(), {"name": "spare", "profile": "delta-dtb", "url": "sim://flexinol-lt-0.15mm", "measures": []}]
    with Rig(rig_of(both)) as rig:
        assert rig.heater.exchange(0.0).temperature_c == pytest.approx(22.0, abs=1.0)


def test_a_supply_without_a_voltage_limit_does_not_heat():
    config = rig_of(devices())
    config = config.model_copy(update={"limits": config.limits.model_copy(update={"voltage_max_v": None})})
    with pytest.raises(ConfigError) as error, Rig(config) as rig:
        rig.heater.arm(1.0)
    assert error.value.where == "voltage_max_v"


@pytest.mark.parametrize("profile", ["riden-rd60xx", "xy-sk-family", "hanmatek-hm30x", "juntek-dpm86xx"])
def test_any_supply_heats_the_wire_under_its_own_protections(profile):
    config = rig_of(devices(supply={"profile": profile}), rate_hz=2.0)
    with Rig(config) as rig:
        rig.heater.arm(1.0)
        for _ in range(40):
            rig.clock.sleep_until(rig.clock.now_s() + 0.5)
            last = rig.heater.exchange(0.25)
        assert last.armed
        assert last.current_a == pytest.approx(0.25, abs=0.011)
        assert last.temperature_c > 60.0
        supply = rig.devices["supply"]
        for role, limit in (("ovp", 15.0), ("ocp", 0.4)):
            if (name := getattr(supply.profile.roles, role)) is not None:
                assert supply.read((name,))[name].value == pytest.approx(1.1 * limit, rel=0.02)


def test_supply_comes_back_off_after_a_power_failure(bench):
    """At its panel the output was set to come back on. The driver sets it to stay off."""
    supply = bench.devices["supply"]
    supply.firmware.write({"boot_power": 1.0})
    with bench.rig as rig:
        rig.heater.arm(1.0)
        bench.heat(rig, 0.25, 4)
        supply.power_cycle()
        assert supply.firmware.set_a == pytest.approx(0.25)
        assert supply.firmware.current_a == 0.0


@pytest.mark.parametrize("steps", [155.9, 160.0, 300.0])
def test_command_is_rounded_down_to_a_step_of_the_supply(bench, steps):
    with bench.rig as rig:
        rig.heater.arm(1.0)
        supply = rig.devices["supply"]
        step_a = supply.profile.register("i_set").scale
        bench.heat(rig, steps * step_a, 2)
        assert bench.devices["supply"].firmware.set_a == pytest.approx(int(steps) * step_a)


def test_lost_exchange_leaves_the_earlier_current_in_force(bench):
    with bench.rig as rig:
        rig.heater.arm(1.0)
        bench.heat(rig, 0.25, 2)
        bench.devices["supply"].faults.drop(10)
        with pytest.raises(DeadlineError):
            bench.heat(rig, 0.05, 1)
        bench.devices["supply"].faults.clear()
        rig.clock.sleep_until(rig.clock.now_s() + rig.devices["supply"].profile.timing.response_timeout_ms / 1e3)
        (after,) = bench.heat(rig, 0.05, 1)
        assert after.in_force_a == pytest.approx(after.current_a, abs=0.01)


def test_supply_too_small_for_the_limit_is_not_armed():
    config = rig_of(devices(supply={"profile": "juntek-dpm86xx"}), current_max_a=5.5, voltage_max_v=120.0)
    with pytest.raises(ConfigError) as error, Rig(config) as rig:
        rig.heater.arm(1.0)
    assert (error.value.where, error.value.limit) == ("current_max_a", "5 A")


def test_a_twin_that_comes_back_at_the_supplys_port_confirms_nothing(bench):
    sim = load_sim("flexinol-lt-0.15mm")
    board = sim.board.model_copy(update={"serial_number": 2})
    twin = SimulatedBench(sim.model_copy(update={"board": board})).attach(load_profile("riden-rd60xx"))
    plug = Plug(bench.devices["supply"])
    port = bench.transports["supply"] = InProcessTransport(plug, bench.transports["supply"].clock)

    def swapped_while_it_heats():
        with bench.rig as rig:
            rig.heater.arm(1.0)
            bench.heat(rig, 0.25, 4)
            plug.device = twin
            port.disconnect()
            bench.heat(rig, 0.25, 1)

    with pytest.raises(IdentityError) as caught:
        swapped_while_it_heats()
    assert caught.value.value.startswith("serial_number = 2, was ")
    assert any("could NOT be confirmed off" in note for note in caught.value.__notes__)
    assert bench.devices["supply"].firmware.current_a > 0.0


def test_silent_laser_raises_at_once(bench):
    bench.devices["laser"].faults.drop(1_000_000)
    with pytest.raises(DeadlineError), bench.rig:
        pass
