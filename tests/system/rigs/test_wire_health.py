"""Runs add to the health record of their wire; the record shows drift, a jump trips, and nothing spoils a run."""

import json
import shutil
import sys
from contextlib import contextmanager, nullcontext

import programs
import pytest

from firmware_sim.bench import simulated_device
from firmware_sim.config import load_sim
from smadrive.clock import VirtualClock
from smadrive.control.references.shapes import sine
from smadrive.errors import SafetyError, TripError
from smadrive.files.shipped import configs_dir
from smadrive.rig.config import load_rig
from smadrive.rig.rig import Rig
from smadrive.runs.experiments import track
from smadrive.runs.health.assessment import assess, assessment_of, expected_of, health_values
from smadrive.runs.health.recording import health_recorded, record_health
from smadrive.runs.log.reader import read_log
from smadrive.runs.tracking_plan import plan_tracking
from smadrive.safety.faults import Fault
from smadrive.wire.health.drift import HealthVerdict
from smadrive.wire.health.expected_rest import LEAST_RUNS, LEAST_TOLERANCE, MOST_TOLERANCE
from smadrive.wire.health.record import health_file, read_health
from smadrive.wire.identified_wire import load_wire

CONFIG = load_rig("in-process")
SIM = load_sim("flexinol-lt-0.15mm")
SWING = sine(low_mm=2.0, high_mm=9.0, period_s=20.0, cycles=1.0)
INTERRUPTED_S = 15.0


@pytest.fixture
def wire_file(identified, tmp_path):
    """The file of the identified wire, in a folder of this test: its record is empty."""
    return shutil.copy(identified.wire_file, tmp_path / "wire.json")


@contextmanager
def opened(prepare=lambda _plant: None, config=CONFIG):
    """The rig of `config`, with its wire prepared by `prepare(plant)`."""
    device, clock = simulated_device(SIM, seed=3), VirtualClock()
    clock.follow(device.bench.advance_to)
    prepare(device.bench.plant)
    with Rig(config, transports={"board": device.transport(clock)}) as rig:
        yield rig


def run(wire_file, name="run.h5", prepare=lambda _plant: None, on_tick=lambda _tick: None, config=CONFIG):
    """Track `SWING` and record the run. Return the log file."""
    log_file = wire_file.with_name(name)

    def watch(recorder, _duration_s):
        def record(tick):
            recorder.tick(tick)
            on_tick(tick)

        return nullcontext(record)

    with opened(prepare, config) as rig:
        plan = plan_tracking(rig, SWING, load_wire(wire_file), smooth=True, smooth_option="--smooth")
        track(log_file, rig, plan, watch)
    return log_file


def found(wire_file):
    return assess(wire_file, CONFIG.feedback)


@pytest.mark.exhaustive
def test_record_shows_an_aged_wire(wire_file):
    def age(plant):
        plant.ageing.age_wire(1.5, 0.01, 0.04)

    for name in ("run1.h5", "run2.h5"):
        assert record_health(run(wire_file, name, age)) == ()
    identified, *runs = read_health(wire_file).entries
    assert identified.is_identification
    assert [entry.cycles for entry in runs] == [1.0] * 2
    health = found(wire_file).health
    assert health.verdict is HealthVerdict.IDENTIFY_AGAIN
    assert health.drifts["heating_c"].change.value == pytest.approx(1.5, abs=0.3)
    assert health.drifts["cooling_c"].change.value == pytest.approx(1.5, abs=0.3)
    assert health.drifts["stroke_mm"].change.value == pytest.approx(-0.04 * 12.0, abs=0.2)
    assert not health.drifts["rest_ohm"].counts
    assert health_values(assessment_of(read_log(wire_file.with_name("run2.h5"))))["verdict"] == "identify it again"


@pytest.mark.exhaustive
def test_run_without_a_measured_displacement_shows_no_drift(wire_file):
    devices = tuple(device.model_copy(update={"measures": ("temperature",)}) for device in CONFIG.devices)
    blind = CONFIG.model_copy(update={"devices": devices})
    assert record_health(run(wire_file, config=blind, prepare=lambda plant: plant.ageing.age_wire(4.0, 0.0, 0.0))) == ()
    (entry,) = read_health(wire_file).entries[1:]
    assert entry.estimated_rest_ohm.is_known
    assert not any(value.is_known for value in (entry.rest_ohm, entry.heating_c, entry.cooling_c, entry.stroke_mm))


@pytest.mark.exhaustive
def test_cracked_crimp_trips_once_the_runs_of_the_wire_are_recorded(wire_file):
    assert expected_of(load_wire(wire_file)).tolerance == MOST_TOLERANCE
    log_file = run(wire_file)
    for _ in range(LEAST_RUNS):
        assert record_health(log_file) == ()
    assert expected_of(load_wire(wire_file)).tolerance == LEAST_TOLERANCE
    with pytest.raises(TripError) as trip:
        run(wire_file, "cracked.h5", lambda plant: plant.faults.corrode_contact(1.0))
    assert trip.value.number == Fault.RESISTANCE_JUMPED.number
    assert record_health(wire_file.with_name("cracked.h5")) == ()
    assert read_health(wire_file).entries[-1].tripped
    assert expected_of(load_wire(wire_file)).tolerance == LEAST_TOLERANCE


@pytest.mark.exhaustive
def test_jump_is_latched(wire_file):
    with opened(lambda plant: plant.faults.corrode_contact(8.0)) as rig:
        plan = plan_tracking(rig, SWING, load_wire(wire_file), smooth=True, smooth_option="--smooth")
        with pytest.raises(TripError):
            track(wire_file.with_name("a.h5"), rig, plan, lambda recorder, _s: nullcontext(recorder.tick))
        with pytest.raises(SafetyError):
            track(wire_file.with_name("b.h5"), rig, plan, lambda recorder, _s: nullcontext(recorder.tick))


@pytest.mark.exhaustive
def test_interrupted_run_is_recorded(wire_file):
    def interrupt(tick):
        if tick.time_s > INTERRUPTED_S:
            raise KeyboardInterrupt

    warnings = []
    with pytest.raises(KeyboardInterrupt), health_recorded(wire_file.with_name("run.h5"), warnings.extend):
        run(wire_file, on_tick=interrupt)
    assert not warnings
    assert [entry.kind for entry in read_health(wire_file).entries] == ["identification", "tracking"]


def break_by_folder(record):
    record.mkdir()


def break_by_junk(record):
    record.write_bytes(b"\0junk\n" * 5)


@pytest.mark.exhaustive
@pytest.mark.parametrize("spoil", [break_by_folder, break_by_junk])
def test_unusable_record_spoils_no_run(wire_file, spoil):
    spoil(health_file(wire_file))
    log_file = run(wire_file)
    (warning,) = record_health(log_file)
    assert str(health_file(wire_file)) in warning
    assert len(found(wire_file).caveats) == 1
    assert found(wire_file).health is None


@pytest.mark.exhaustive
def test_lost_wire_file_spoils_no_run(wire_file):
    log_file = run(wire_file)
    wire_file.unlink()
    assert len(record_health(log_file)) == 1
    assert assessment_of(read_log(log_file)) is None


@pytest.mark.exhaustive
def test_other_model_in_the_same_file_is_another_identification(wire_file):
    log_file = run(wire_file)
    record_health(log_file)
    document = json.loads(wire_file.read_text())
    wire_file.write_text(json.dumps(document | {"scale": 1.01 * document["scale"]}))
    record_health(log_file)
    assert [entry.is_identification for entry in read_health(wire_file).entries] == [True, False, True, False]


@pytest.mark.exhaustive
def test_commands_show_the_health(wire_file, tmp_path):
    """`run` adds an entry; `probe` and `report` show the health, as a table and as JSON."""
    text = configs_dir().joinpath("rigs", "in-process.toml").read_text(encoding="utf-8")
    (tmp_path / "rig.toml").write_text(f'model = "wire.json"\n{text}')
    reference = ["--reference", "sine:low_mm=2,high_mm=9,period_s=20,cycles=1", "--smooth"]

    def smadrive(*arguments):
        command = [sys.executable, "-m", "smadrive", *arguments]
        done = programs.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return done.stdout

    assert json.loads(smadrive("probe", "rig.toml", "--json"))["wire"] is None
    for name in ("a.h5", "b.h5"):
        smadrive("run", "rig.toml", *reference, "-o", name)
    assert json.loads(smadrive("probe", "rig.toml", "--json"))["wire"]["verdict"] == "as identified"
    assert json.loads(smadrive("probe", "in-process", "--model", "wire.json", "--json"))["wire"]["runs"] == 2
    assert "resistance" in smadrive("probe", "rig.toml")
    assert json.loads(smadrive("report", "b.h5", "--json"))["wire"]["cycles"] == 2.0
    assert "Health of the wire" in (tmp_path / "b.html").read_text(encoding="utf-8")
