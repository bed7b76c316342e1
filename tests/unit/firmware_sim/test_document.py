"""docs/simulator.md lists every fault, and its examples load."""

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


def test_document_lists_every_fault(simulated):
    listed = set(re.findall(r"`(\w+)`", PAGE))
    assert set(simulated.bench.known_faults()) <= listed


def test_example_script_runs(simulated, tmp_path):
    path = tmp_path / "faults.toml"
    path.write_text(re.search(r"```toml\n(\[\[faults.*?)```", PAGE, re.DOTALL)[1], encoding="utf-8")
    simulated.bench.follow_script(load_script(path))
    simulated.bench.advance_to(13.0)
    assert any("fault: delay delay_s = 0.3, replies = 5" in event for event in simulated.bench.events)


def test_example_of_several_devices_loads():
    tables = tomllib.loads(re.search(r"```toml\n(\[\[devices.*?)```", PAGE, re.DOTALL)[1])
    shipped = read_toml(config_file("flexinol-lt-0.15mm", SIM))
    config = validate(shipped | tables, SimConfig, where="docs/simulator.md")
    bench = SimulatedBench(config)
    devices = [bench.attach(load_profile(entry.profile), entry.unit_id, entry.name) for entry in config.devices]
    Line(devices[1:])
    assert "wire.drop" in bench.known_faults()
