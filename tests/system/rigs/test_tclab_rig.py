"""A rig whose heat source is a TCLab board: text instead of Modbus, in virtual time and on a port."""

import contextlib
import json
import signal
import subprocess
import sys
from pathlib import Path

import programs
import pytest
from exact_wire import exact_wire
from marks import exhaustive
from served import PATIENT

from firmware_sim.bench import SimulatedBench
from firmware_sim.config import load_sim
from firmware_sim.devices.replay import Replay
from smadrive.clock import VirtualClock
from smadrive.control.controllers.step import ManualStep
from smadrive.control.feedforward.displacement import HysteresisInverse
from smadrive.control.references.shapes import sine
from smadrive.devices.identity import TypeCheck
from smadrive.devices.profile.profile import load_profile
from smadrive.errors import ConfigError, TripError
from smadrive.hysteresis import DuhemModel, save_model
from smadrive.identification.wire import identify_wire
from smadrive.rig.config import RigConfig, load_rig
from smadrive.rig.controllers import step_controller
from smadrive.rig.rig import Rig
from smadrive.runs.health.entries import run_entry
from smadrive.runs.log.reader import read_log
from smadrive.runs.metrics.run import tracking_metrics
from smadrive.runs.run_log import record_excitation, record_step, record_tracking
from smadrive.runs.run_metadata import excitation_record, nominal_balance
from smadrive.safety.faults import Fault
from smadrive.wire.wire_model import WireModel, travel_mm

SIM = "sim://flexinol-lt-0.15mm"
BOARD = {"name": "board", "profile": "tclab", "url": SIM, "full_scale_a": 1.0, "full_scale_v": 16.5}
LASER = {"name": "laser", "profile": "baumer-om20", "url": SIM}


def rig_of(*devices):
    """Return the shipped rig with other devices."""
    return RigConfig.model_validate(load_rig("tclab").model_dump(exclude_none=True) | {"devices": devices})


@pytest.mark.exhaustive
def test_wire_on_a_tclab_is_excited_identified_and_tracked(tmp_path):
    excited, tracked = tmp_path / "excited.h5", tmp_path / "tracked.h5"
    with Rig(rig_of(BOARD, LASER)) as rig:
        assert rig.identities["board"].check is TypeCheck.PROVED
        excitation = rig.excitation(22.0)
        with record_excitation(excited, rig, excitation) as recorder:
            rig.excite(excitation, recorder.tick)
    log = read_log(excited)
    wire = identify_wire(excitation_record(log), nominal_balance(log))
    assert wire.hysteresis.rms_percent < 2.0
    model = wire.hysteresis.model
    cold_mm, hot_mm = travel_mm(model)
    low_mm, high_mm = (cold_mm + part * (hot_mm - cold_mm) for part in (0.2, 0.8))
    reference = sine(low_mm=low_mm, high_mm=high_mm, period_s=56.0, cycles=1.5).with_approach(cold_mm, 10.0)
    experiment = reference, WireModel(model, wire.thermal.balance), HysteresisInverse(model)
    with Rig(rig_of(BOARD, LASER)) as rig, record_tracking(tracked, rig, *experiment) as recorder:
        loop = rig.track(*experiment, recorder.tick)
    figures = tracking_metrics(read_log(tracked), loop)
    assert figures.trips == 0
    assert figures.rms_percent <= 3.0


@pytest.mark.exhaustive
def test_tclab_runs_without_displacement_sensor_and_with_unknown_error(tmp_path):
    rig = tmp_path / "rig.toml"
    rig.write_text(_toml(load_rig("tclab"), SIM))
    wire = DuhemModel.gaussian(
        mu_heating=89.9, mu_cooling=69, sigma_heating=5, sigma_cooling=5, scale=12, input_range=(0, 200)
    )
    save_model(wire, tmp_path / "wire.json")
    reference = ("--reference", "sine:low_mm=2,high_mm=9,period_s=40,cycles=1")
    run = ("run", str(rig), "--model", str(tmp_path / "wire.json"), *reference)
    done = smadrive(*run, "-o", str(tmp_path / "a.h5"), "--json")
    assert done.returncode == 0, done.stderr
    figures = json.loads(done.stdout)
    assert (figures["rms_percent"], figures["max_percent"], figures["trips"]) == (None, None, 0)
    assert "no working displacement sensor" in figures["caveats"][0]
    printed = smadrive(*run, "-o", str(tmp_path / "b.h5")).stdout
    assert "unknown" in printed
    assert "no working displacement sensor" in printed


@pytest.mark.parametrize(("devices", "is_measured"), [((BOARD, LASER), False), (None, True)], ids=["tclab", "board"])
def test_only_a_measured_resistance_is_recorded(tmp_path, devices, is_measured):
    log_file, step = tmp_path / "heat.h5", ManualStep(0.25, None, 6.0)
    with (
        Rig(rig_of(*devices) if devices else load_rig("in-process")) as rig,
        record_step(log_file, rig, step) as recorder,
    ):
        rig.drive(step_controller(rig.config, step, rig.nominal_balance), rig.nominal_balance, recorder.tick)
    exact_wire().save(tmp_path / "wire.json")
    assert run_entry(read_log(log_file), tmp_path / "wire.json").rest_ohm.is_known is is_measured


def test_trace_of_text_lines_is_readable_but_cannot_be_served_again(tmp_path):
    with Rig(rig_of(BOARD, LASER), trace_folder=tmp_path):
        pass
    lines = (tmp_path / "board.trace").read_text().splitlines()
    assert lines[0] == "# smadrive bus trace 1: text, in process"
    assert {line.partition("| ")[2] for line in lines} >= {"VER", "TCLab Firmware 2.0.1 Arduino Uno"}
    with pytest.raises(ConfigError) as error:
        Replay(tmp_path / "board.trace")
    assert error.value.value == "text"
    assert Replay(tmp_path / "laser.trace").units


@pytest.fixture
def bench():
    """Return a simulated bench with the board, and the rig that is connected to the board."""
    bench = SimulatedBench(load_sim("flexinol-lt-0.15mm"), seed=3)
    clock = VirtualClock()
    clock.follow(bench.advance_to)
    board = bench.attach(load_profile("tclab"))
    return bench, Rig(rig_of(BOARD), transports={"board": board.transport(clock)})


@pytest.mark.parametrize(
    ("fault", "number"),
    [
        (lambda bench: bench.sensors.faults.open_thermocouple(), Fault.SENSOR_INVALID),
        (lambda bench: bench.sensors.faults.freeze_thermocouple(), Fault.SENSOR_FROZEN),
        (lambda bench: bench.plant.faults.break_wire(), Fault.READS_TOO_COLD),
        (lambda bench: bench.devices[0].power_cycle(), Fault.STALE_DATA),
        (lambda bench: bench.devices[0].firmware.restart(), Fault.COMMAND_REFUSED),
        (lambda bench: bench.devices[0].faults.drop(for_s=2.0), Fault.STALE_DATA),
        (lambda bench: bench.devices[0].faults.vanish(for_s=1.0), Fault.STALE_DATA),
    ],
    ids=["open", "frozen", "broken wire", "power", "restart", "silence", "unplugged"],
)
def test_every_fault_ends_without_heat(bench, fault, number):
    bench, rig = bench
    begun = []

    def record(tick):
        if tick.time_s > 3.0 and bench.plant.current_a > 0.2 and not begun:
            begun.append(fault(bench))

    with pytest.raises(TripError) as caught, rig:
        rig.excite(rig.excitation(22.0), record)
    assert caught.value.number == number.number
    assert bench.devices[0].firmware.current_a == 0.0


def test_board_that_gives_less_than_the_current_limit_is_refused():
    with pytest.raises(ConfigError, match="current_max_a"), Rig(rig_of(BOARD | {"full_scale_a": 0.5})) as rig:
        rig.excite(rig.excitation(22.0), lambda _tick: None)


@contextlib.contextmanager
def served(tmp_path, *arguments):
    """Yield the board on a port of its own, and a rig file with this port."""
    command = [sys.executable, "-m", "firmware_sim.cli", "flexinol-lt-0.15mm", "--profile", "tclab", *arguments]
    with programs.Program(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            url = process.stdout.readline().strip()
            rig = tmp_path / "rig.toml"
            base = (load_rig("tclab"), f"{url}{PATIENT}")
            rig.write_text(_toml(*base))
            yield process, url, str(rig)
        finally:
            process.kill()


def _toml(config, url):
    patient = {"watchdog_s": 10.0, "stale_after_s": 10.0}
    limits = config.limits.model_dump(exclude_none=True) | patient
    limits = "\n".join(f"{name} = {value}" for name, value in limits.items())
    board = "\n".join(f"{name} = {json.dumps(value)}" for name, value in (BOARD | {"url": url}).items())
    return (
        f'name = "served"\nwire = "{config.wire}"\nrate_hz = 20.0\n[[devices]]\n{board}\n[limits]\n{limits}\n'
        "[excitation]\nlow_c = 40.0\nhigh_c = 60.0\nrate_c_per_s = 6.0\n"
    )


def smadrive(*arguments):
    command = [sys.executable, "-m", "smadrive", *arguments]
    return programs.run(command, check=False, capture_output=True, text=True)


@pytest.mark.parametrize("arguments", [exhaustive(()), ("--rtu-tcp", "0")], ids=["pty", "tcp"])
def test_tclab_on_a_port_is_found_probed_and_switched_off(tmp_path, arguments):
    with served(tmp_path, *arguments) as (_, url, rig):
        address = url + PATIENT + ("&baudrate=115200" if url.startswith("serial") else "")
        (found,) = json.loads(smadrive("scan", address, "--units", "1", "--json").stdout)["devices"]
        assert (found["unit_id"], found["profiles"]) == (None, ["tclab"])
        probed = json.loads(smadrive("probe", rig, "--json").stdout)
        assert probed["devices"] == {"board": "tclab (TCLab on Arduino)"}
        assert probed["temperature_c"] == pytest.approx(22.0, abs=1.0)
        assert json.loads(smadrive("off", rig, "--json").stdout)["safe"]


DRIVER = """
import sys, time
from smadrive.rig.rig import Rig
from smadrive.rig.config import load_rig
with Rig(load_rig(sys.argv[1])) as rig:
    rig.heater.arm(10.0)
    for tick in range(10_000):
        rig.heater.exchange(0.2)
        time.sleep(0.05)
"""


def test_guardian_switches_a_tclab_off_after_its_driver_was_killed(tmp_path):
    with (
        served(tmp_path) as (board, _, rig),
        programs.Program([sys.executable, "-c", DRIVER, rig], stderr=subprocess.PIPE, text=True) as driver,
    ):
        assert board.stderr.readline().endswith("Q1: heater on, no watchdog\n")
        driver.send_signal(signal.SIGKILL)
        assert board.stderr.readline().endswith("Q1: heater off\n")
        said = driver.communicate(timeout=300)[1]
        assert "heater off, confirmed by read-back" in said


@pytest.mark.parametrize("arguments", [("--tcp", "0")])
def test_tclab_cannot_be_served_on_modbus_tcp(tmp_path, arguments):
    command = [sys.executable, "-m", "firmware_sim.cli", "flexinol-lt-0.15mm", "--profile", "tclab", *arguments]
    done = programs.run(command, check=False, capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 2
    assert "'tclab' does not speak Modbus. Serve it alone, with --pty PATH or --rtu-tcp HOST:PORT" in done.stderr


def test_off_needs_no_full_scales(tmp_path):
    with served(tmp_path) as (_, _, rig):
        text = Path(rig).read_text()
        for wrong in ('full_scale_a = "1"', ""):
            Path(rig).write_text(text.replace("full_scale_a = 1.0", wrong))
            assert smadrive("off", rig).returncode == 0
