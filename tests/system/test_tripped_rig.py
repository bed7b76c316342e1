"""A rig that tripped heats again only after somebody has cleared the fault, whatever was started anew since then."""

import json
import re
import subprocess
import sys

import pytest

from smadrive.control.faults import Fault
from smadrive.errors import SafetyError, TripError
from smadrive.latch import TripLatch
from smadrive.rig import Rig
from smadrive.rigconfig import load_rig
from smadrive.shipped import configs_dir
from smadrive.testing.simulator import ServedSimulator
from tests.served import served


def heat(rig):
    rig.excite(rig.excitation(22.0), lambda _: None)


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
    return subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout


def off(rig_file, *options):
    """What `smadrive off` tells as JSON."""
    return json.loads(smadrive("off", rig_file, "--json", *options))


def test_probe_and_off_tell_what_is_latched_and_off_clears_it(tmp_path):
    rig_file = tmp_path / "rig.toml"
    shipped = (configs_dir() / "rigs" / "simulated.toml").read_text()
    with served() as (_, url):
        rig_file.write_text(re.sub('url = ".*"', f'url = "{url}"', shipped))
        TripLatch(f"{url} unit 1").latch(TripError("fault 8: reads too cold", 8))
        told = smadrive("probe", rig_file)
        assert "latched: fault 8: reads too cold\n" in told
        assert f"once its cause is gone: smadrive off {rig_file} --clear-faults\n" in told
        assert json.loads(smadrive("probe", rig_file, "--json"))["tripped"] == "fault 8: reads too cold"
        assert off(rig_file)["faults"] == ["fault 8: reads too cold"]
        assert off(rig_file, "--clear-faults")["faults"] == []
        assert off(rig_file)["faults"] == []
        assert "latched" not in smadrive("probe", rig_file)
