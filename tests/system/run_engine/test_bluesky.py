"""A wire under a real run engine: protocols, scan, fly, trips and configuration."""

from math import isnan

import numpy as np
import pytest
from bluesky import plan_stubs as bps
from bluesky import plans as bp
from bluesky import preprocessors as bpp
from bluesky import protocols
from bluesky.simulators import check_limits
from bluesky.utils import FailedStatus

import smadrive
from smadrive.bluesky import SmaWire
from smadrive.control.references.reference import Reference
from smadrive.errors import ConfigError, SafetyError, TripError
from smadrive.rig.config import load_rig

from .conftest import SINE, is_off

MAJOR = 2
TRIANGLE = [0.0, 10.0, 20.0], [3.0, 7.0, 3.0]
"""Times in s, and displacements in mm."""

TRIANGLE_MM = np.interp(np.linspace(0.0, 20.0, 401), *TRIANGLE)
"""The triangle at each tick, from its first to its last moment, at 20 Hz."""

PROTOCOLS = (
    *("Readable", "Movable", "NamedMovable", "Locatable", "Triggerable", "Stoppable", "Configurable", "Stageable"),
    *("Flyable", "EventCollectable", "Checkable", "HasHints", "HasName", "HasParent", "Pausable", "Preparable"),
)


@pytest.mark.parametrize("name", PROTOCOLS)
def test_protocol_is_followed(wire, name):
    assert isinstance(wire, getattr(protocols, name))


def test_status_of_a_motion_is_one_of_bluesky(wire):
    assert isinstance(wire.trigger(), protocols.Status)
    assert set(wire.read()) == set(wire.describe())
    assert set(wire.read_configuration()) == set(wire.describe_configuration())
    assert wire.hints == {"fields": ["wire_displacement_mm"]}
    assert wire.describe()["wire_temperature_c"]["units"] == "degC"
    assert isnan(wire.read()["wire_setpoint_mm"]["value"])
    assert wire.locate()["readback"] == wire.read()["wire_displacement_mm"]["value"]


def test_scan_over_displacement(engine, documents, rig, wire):
    engine(bp.scan([], wire, 2.0, 8.0, 4))
    assert is_off(rig, wire)
    (start,), (stop,), (descriptor,) = documents.of("start"), documents.of("stop"), documents.of("descriptor")
    assert (start["plan_name"], stop["exit_status"], stop["num_events"]) == ("scan", "success", {"primary": 4})
    assert descriptor["hints"]["wire"] == wire.hints
    assert descriptor["configuration"]["wire"]["data"]["wire_tolerance_mm"] == 0.2
    assert descriptor["configuration"]["wire"]["data"]["wire_log_file"] == wire.log_file
    rows = documents.events()
    assert [row["wire_setpoint_mm"] for row in rows] == [2.0, 4.0, 6.0, 8.0]
    np.testing.assert_allclose([row["wire_displacement_mm"] for row in rows], [2.0, 4.0, 6.0, 8.0], atol=0.2)


@pytest.mark.exhaustive
def test_two_wires_that_move_at_once_write_two_logs(engine, wire, other_wire):
    engine(bps.mv(wire, 4.0, other_wire, 4.0))
    assert wire.log_file != other_wire.log_file
    for one in (wire, other_wire):
        assert smadrive.read_log(one.log_file).ticks > 0


def test_count_heats_nothing(engine, documents, rig, wire):
    engine(bp.count([wire], 3))
    assert wire._servo is None
    rows = documents.events()
    assert len(rows) == 3
    assert all(row["wire_current_a"] < 0.01 for row in rows)


def test_limits_are_checked_before_the_plan(wire):
    check_limits(bp.scan([], wire, 2.0, 8.0, 4))
    with pytest.raises(ConfigError):
        check_limits(bp.scan([], wire, 2.0, 80.0, 4))
    with pytest.raises(ConfigError):
        wire.set(80.0)


def test_flight_yields_an_event_for_each_tick(engine, documents, rig, wire):
    wire.prepare(Reference.from_samples(*TRIANGLE))
    engine(bpp.stage_wrapper(bp.fly([wire]), [wire]))
    assert is_off(rig, wire)
    rows = documents.events()
    np.testing.assert_allclose([row["wire_setpoint_mm"] for row in rows], TRIANGLE_MM, atol=1e-6)
    assert documents.of("descriptor")[0]["name"] == "wire_fly"
    times_s = [time_s for page in documents.of("event_page") for time_s in page["timestamps"]["wire_displacement_mm"]]
    assert len(times_s) == len(rows)
    np.testing.assert_allclose(np.diff(times_s), 0.05, atol=0.005)


@pytest.mark.exhaustive
def test_flight_may_be_collected_in_parts(rig, wire):
    wire.stage()
    wire.prepare(Reference.from_samples(*TRIANGLE))
    wire.kickoff().wait()
    events = list(wire.collect())
    for _ in range(3):
        wire.trigger().wait()
        events += wire.collect()
    wire.complete().wait()
    wire.unstage()
    events += wire.collect()
    np.testing.assert_allclose([event["data"]["wire_setpoint_mm"] for event in events], TRIANGLE_MM, atol=1e-6)
    times_s = [event["time"] for event in events]
    np.testing.assert_allclose(np.diff(times_s), 0.05, atol=0.005)


def test_flight_needs_a_stage_and_a_reference(rig, wire):
    with pytest.raises(ConfigError, match="no reference"):
        wire.kickoff()
    with pytest.raises(ConfigError):
        wire.prepare(smadrive.sine(low_mm=3, high_mm=70, period_s=20))
    wire.prepare(SINE)
    with pytest.raises(ConfigError, match="staged"):
        wire.kickoff()
    with pytest.raises(ConfigError, match="nothing flies"):
        wire.complete()


def test_readback_after_a_move_is_a_new_measurement(rig, wire):
    wire.stage()
    cold_mm = wire.locate()["readback"]
    wire.set(6.0).wait()
    wire.stop()
    assert wire.locate()["readback"] == pytest.approx(rig.measure().displacement_mm, abs=0.1)
    assert wire.locate()["readback"] > cold_mm + 1.0
    wire.unstage()


def severity_of(wire):
    """The severity of the alarm of a fresh reading."""
    wire.trigger().wait()
    return wire.read()["wire_current_a"]["alarm_severity"]


@pytest.mark.exhaustive
def test_trip_is_a_failed_status(engine, documents, identified):
    config = load_rig("in-process")
    limits = config.limits.model_copy(update={"tracking_max_mm": 0.5, "tracking_for_s": 0.2})
    with smadrive.open_rig(config.model_copy(update={"limits": limits})) as rig:
        wire = SmaWire(rig, identified.wire_file, speed_mm_per_s=100.0)  # faster than the wire
        with pytest.raises(FailedStatus) as failed:
            engine(bp.scan([], wire, 4.0, 8.0, 2))
        assert isinstance(failed.value.args[0].exception(), TripError)
        assert documents.of("stop")[0]["exit_status"] == "fail"
        assert is_off(rig, wire)
        assert isinstance(wire.set(4.0).exception(None), SafetyError)
        wire.stop()
        assert severity_of(wire) == MAJOR
        rig.clear_faults()
        assert severity_of(wire) == 0


def test_configuration_changes(wire):
    before, after = wire.configure(settle_s=2.0)
    assert (before["wire_settle_s"]["value"], after["wire_settle_s"]["value"]) == (1.0, 2.0)
    assert wire.configure({"settle_s": 3.0})[1]["wire_settle_s"]["value"] == 3.0
    with pytest.raises(ConfigError):
        wire.configure(settle=2.0)
    with pytest.raises(ConfigError):
        wire.configure({"settle": 2.0})
    with pytest.raises(ConfigError):
        wire.configure(tolerance_mm=-1.0)
    assert wire.read_configuration()["wire_tolerance_mm"]["value"] == 0.2
