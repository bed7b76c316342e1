"""Every shipped config file loads and is of the kind of its folder."""

from pathlib import Path

import pytest

from firmware_sim.config import load_sim
from smadrive.device.profile import load_profile
from smadrive.rigconfig import load_rig, load_wire

CONFIGS = Path(__file__).parents[2] / "configs"
LOADERS = {"devices": load_profile, "wires": load_wire, "rigs": load_rig, "sims": load_sim}


@pytest.mark.parametrize("path", sorted(CONFIGS.rglob("*.*")), ids=lambda path: str(path.relative_to(CONFIGS)))
def test_it_loads_by_path_and_by_name(path):
    load = LOADERS[path.parent.name]
    assert load(str(path)) == load(path.stem)


def test_the_parts_that_a_rig_names_exist():
    for path in (CONFIGS / "rigs").glob("*.toml"):
        rig = load_rig(str(path))
        assert load_wire(rig.wire).heat_balance().time_constant_s > 0
        for device in rig.devices:
            load_profile(device.profile)
