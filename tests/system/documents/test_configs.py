"""Every shipped config file loads and is of the kind of its folder."""

from pathlib import Path

import pytest

from firmware_sim.config import load_sim
from smadrive.campaigns.plan.config import load_campaign
from smadrive.devices.profile.profile import load_profile
from smadrive.rig.config import load_rig
from smadrive.wire.data_sheet import load_data_sheet

CONFIGS = Path(__file__).parents[3] / "configs"
LOADERS = {
    "devices": load_profile,
    "wires": load_data_sheet,
    "rigs": load_rig,
    "sims": load_sim,
    "campaigns": load_campaign,
}


@pytest.mark.parametrize("path", sorted(CONFIGS.rglob("*.*")), ids=lambda path: str(path.relative_to(CONFIGS)))
def test_config_loads_by_path_and_by_name(path):
    load = LOADERS[path.parent.name]
    assert load(str(path)) == load(path.stem)


def test_files_that_a_rig_names_exist():
    for path in (CONFIGS / "rigs").glob("*.toml"):
        rig = load_rig(str(path))
        assert load_data_sheet(rig.wire).heat_balance().time_constant_s > 0
        for device in rig.devices:
            load_profile(device.profile)
