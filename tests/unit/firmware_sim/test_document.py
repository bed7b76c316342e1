"""docs/simulator.md tells every fault there is, and its example is one that can be played."""

import re
import tomllib
from pathlib import Path

from firmware_sim.bench import SimulatedBench
from firmware_sim.config import SimConfig
from firmware_sim.devices.device import Line
from firmware_sim.fault_script import load_script
from smadrive.devices.profile.profile import load_profile
from smadrive.files.config import read_toml, validate
from smadrive.files.kinds import SIM
from smadrive.files.shipped import config_file

PAGE = (Path(__file__).parents[3] / "docs" / "simulator.md").read_text(encoding="utf-8")


def test_every_fault_is_told(rig):
    told = set(re.findall(r"`(\w+)`", PAGE))
    assert set(rig.bench.known_faults()) <= told


def test_the_example_can_be_played(rig, tmp_path):
    path = tmp_path / "faults.toml"
    path.write_text(re.search(r"```toml\n(\[\[faults.*?)```", PAGE, re.DOTALL)[1], encoding="utf-8")
    rig.bench.follow_script(load_script(path))
    rig.bench.advance_to(13.0)
    assert any("fault: delay delay_s = 0.3, replies = 5" in event for event in rig.bench.events)


def test_the_bench_of_several_devices_is_one_that_loads():
    tables = tomllib.loads(re.search(r"```toml\n(\[\[devices.*?)```", PAGE, re.DOTALL)[1])
    shipped = read_toml(config_file("flexinol-lt-0.15mm", SIM))
    config = validate(shipped | tables, SimConfig, where="docs/simulator.md")
    bench = SimulatedBench(config)
    devices = [bench.attach(load_profile(placed.profile), placed.unit_id, placed.name) for placed in config.devices]
    Line(devices[1:])
    assert "wire.drop" in bench.known_faults()
