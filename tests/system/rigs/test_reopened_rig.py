"""A rig that is opened anew for each pulse of current: the heat of the last run counts."""

import re

import pytest
from served import PATIENT, served, with_limits

from smadrive.control.controllers.step import ConstantCurrentController
from smadrive.errors import SafetyError
from smadrive.files.shipped import configs_dir
from smadrive.rig.config import load_rig
from smadrive.rig.rig import Rig

PULSES = 20
LOOSE = "[[faults]]\nat_s = 0.0\nname = 'loosen_bead'\ncontact = 0.01\nover_s = 0.1\n"
THICK = {"diameter_mm": 0.38, "resistance_ohm_per_m": 8.3, "convection_w_per_m2_k": 59.0}
"""The wire of the simulation `flexinol-lt-0.38mm`, which cools so slowly that it is still warm at the next opening."""


def replaced(text, values):
    for key, value in values.items():
        text, count = re.subn(rf"{key} = \S+", f"{key} = {value}", text)
        assert count == 1
    return text


def heat_in_pulses(config):
    for _ in range(PULSES):
        with Rig(config) as rig:
            rig.drive(ConstantCurrentController(2.2, 1.0), rig.nominal_balance, lambda _tick: None)


@pytest.mark.exhaustive
def test_bead_that_has_come_off_is_found_over_several_openings(tmp_path):
    script, wire, rig_file = (tmp_path / name for name in ("faults.toml", "wire.toml", "rig.toml"))
    script.write_text(LOOSE)
    wire.write_text(replaced((configs_dir() / "wires" / "flexinol-lt-0.15mm.toml").read_text(), THICK))
    with served("--faults", script, sim="flexinol-lt-0.38mm") as (_, url):
        shipped = with_limits((configs_dir() / "rigs" / "simulated.toml").read_text(), 5.0, 5.0)
        given = {"url": f'"{url}{PATIENT}"', "wire": f'"{wire}"', "current_max_a": 2.2}
        rig_file.write_text(replaced(shipped, given))
        with pytest.raises(SafetyError, match="colder than the heat input allows"):
            heat_in_pulses(load_rig(rig_file))
