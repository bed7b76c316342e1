"""A tripped rig heats again only after the fault was cleared, also after a new start of driver or device."""

import json
import re
import subprocess
import sys

import programs
import pytest
from served import served

from smadrive.devices.profile.profile import load_profile
from smadrive.devices.state.key import key_at
from smadrive.devices.state.latch import TripLatch
from smadrive.errors import SafetyError, TripError
from smadrive.files.shipped import configs_dir
from smadrive.rig.config import load_rig
from smadrive.rig.rig import Rig
from smadrive.safety.faults import Fault
from smadrive.testing.simulator import ServedSimulator


def heat(rig):
    rig.excite(rig.excitation(22.0), lambda _: None)


@pytest.mark.exhaustive
def test_a_new_start_does_not_clear_a_trip():
    with ServedSimulator("flexinol-lt-0.15mm") as simulator:
        config = load_rig("simulated").at(simulator.url)
        short = config.model_copy(update={"limits": config.limits.model_copy(update={"displacement_max_mm": 0.5})})
        with Rig(short, simulator.clock) as rig, pytest.raises(TripError) as trip:
            heat(rig)
        assert trip.value.number == Fault.OVER_DISPLACEMENT.number
        with (
            Rig(config, simulator.clock) as rig,
            pytest.raises(SafetyError, match=r"fault 11: .*--clear-faults"),
        ):
            heat(rig)
        with Rig(config, simulator.clock) as rig:
            rig.clear_faults()
        with Rig(short, simulator.clock) as rig, pytest.raises(TripError):
            heat(rig)


def smadrive(*arguments):
    command = [sys.executable, "-m", "smadrive", *map(str, arguments)]
    return programs.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout


def off(rig_file, *options):
    """Return the JSON output of `smadrive off`."""
    return json.loads(smadrive("off", rig_file, "--json", *options))


def test_probe_and_off_show_the_latched_trip_and_off_clears_it(tmp_path):
    rig_file = tmp_path / "rig.toml"
    shipped = (configs_dir() / "rigs" / "simulated.toml").read_text()
    with served() as (_, url):
        rig_file.write_text(re.sub('url = ".*"', f'url = "{url}"', shipped))
        key = key_at(url, load_profile("sma-reference"), 1)
        TripLatch(key).latch(TripError("fault 8: reads too cold", 8))
        told = smadrive("probe", rig_file)
        assert "latched: fault 8: reads too cold\n" in told
        assert f"smadrive off {rig_file} --clear-faults\n" in told
        assert json.loads(smadrive("probe", rig_file, "--json"))["tripped"] == "fault 8: reads too cold"
        assert off(rig_file)["faults"] == ["fault 8: reads too cold"]
        assert off(rig_file, "--clear-faults")["faults"] == []
        assert off(rig_file)["faults"] == []
        assert "latched" not in smadrive("probe", rig_file)


def numbered_sim(folder, serial_number):
    """Write a sim file with this serial number of the board, and return its path."""
    path = folder / f"{serial_number}.toml"
    text = (configs_dir() / "sims" / "flexinol-lt-0.15mm.toml").read_text()
    path.write_text(text.replace("[board]", f"[board]\nserial_number = {serial_number}"))
    return path


def trip_at(url, clock):
    """Let the rig at this address trip, by a limit that its wire must exceed."""
    config = load_rig("simulated").at(url)
    short = config.model_copy(update={"limits": config.limits.model_copy(update={"displacement_max_mm": 0.5})})
    with Rig(short, clock) as rig, pytest.raises(TripError):
        heat(rig)


def is_tripped(url, clock):
    with Rig(load_rig("simulated").at(url), clock) as rig:
        return rig.latch.read() is not None


@pytest.mark.exhaustive
def test_a_board_that_comes_back_at_another_port_is_still_tripped(tmp_path):
    sim = numbered_sim(tmp_path, 77)
    with ServedSimulator(str(sim)) as first:
        trip_at(first.url, first.clock)
        with ServedSimulator(str(sim), tcp=True) as moved:
            assert is_tripped(moved.url, moved.clock)


@pytest.mark.exhaustive
def test_another_board_that_gets_the_port_of_a_tripped_one_may_heat(tmp_path):
    with ServedSimulator(str(numbered_sim(tmp_path, 77)), tcp=True) as first:
        trip_at(first.url, first.clock)
        port = first.url.partition("?")[0].rpartition(":")[2]
    with served("--tcp", port) as (_, url):
        assert not is_tripped(url, None)


@pytest.mark.exhaustive
def test_a_simulator_that_gets_the_terminal_of_a_tripped_one_may_heat():
    with ServedSimulator("flexinol-lt-0.15mm") as first:
        trip_at(first.url, first.clock)
        assert is_tripped(first.url, first.clock)
    with ServedSimulator("flexinol-lt-0.15mm") as second:
        assert not is_tripped(second.url, second.clock)


def test_trip_is_latched_before_the_heater_is_switched_off():
    """Otherwise the trip would be lost if the driver is killed while it switches a silent device off."""
    with ServedSimulator("flexinol-lt-0.15mm") as simulator:
        config = load_rig("simulated").at(simulator.url)
        short = config.model_copy(update={"limits": config.limits.model_copy(update={"displacement_max_mm": 0.5})})
        states = []
        with Rig(short, simulator.clock) as rig:
            enter_safe_state = rig.heater.source.enter_safe_state
            rig.heater.source.enter_safe_state = lambda: (states.append(rig.latch.read()), enter_safe_state())[1]
            with pytest.raises(TripError) as trip:
                heat(rig)
            assert states[-1] == trip.value.what
            rig.clear_faults()
