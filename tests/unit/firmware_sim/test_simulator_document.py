"""docs/simulator.md tells every fault there is, and its example is one that can be played."""

import re
from pathlib import Path

from firmware_sim.timeline import load_script

PAGE = (Path(__file__).parents[3] / "docs" / "simulator.md").read_text(encoding="utf-8")


def test_every_fault_is_told(rig):
    told = set(re.findall(r"`(\w+)`", PAGE))
    assert set(rig.bench.known_faults()) <= told


def test_the_example_can_be_played(rig, tmp_path):
    path = tmp_path / "faults.toml"
    path.write_text(re.search(r"```toml\n(.*?)```", PAGE, re.DOTALL)[1], encoding="utf-8")
    rig.bench.follow_script(load_script(path))
    rig.bench.advance_to(13.0)
    assert any("fault: delay delay_s = 0.3, replies = 5" in event for event in rig.bench.events)
