"""A shipped file is found by its name, and a name that is none of them is told from what was meant."""

import pytest

from smadrive.errors import ConfigError
from smadrive.files.kinds import PROFILE, RIG, SIM, WIRE
from smadrive.files.shipped import config_file, configs_dir


def test_a_name_or_a_path_is_found():
    shipped = configs_dir() / "rigs" / "simulated.toml"
    assert config_file("simulated", RIG) == config_file(shipped, RIG) == shipped
    assert config_file("absent.toml", RIG).name == "absent.toml"


@pytest.mark.parametrize(
    ("name", "wanted", "told"),
    [
        (
            "simulatd",
            RIG,
            "'simulatd' is neither a .toml file nor one of the shipped rigs: .*; did you mean 'simulated'",
        ),
        ("flexinol", WIRE, "shipped wires: .*; did you mean 'flexinol-lt-0.15mm'"),
        ("sma-referense", PROFILE, "shipped devices: .*; did you mean 'sma-reference'"),
        ("flexinol-0.15mm", SIM, "shipped sims: .*; did you mean 'flexinol-lt-0.15mm'"),
        ("sma-reference", RIG, "shipped rigs: bench-supply, .*; it is the name of a device profile"),
        ("nothing", RIG, "shipped rigs: bench-supply, in-process, simulated, tclab$"),
    ],
)
def test_another_name_is_told_from_what_was_meant(name, wanted, told):
    with pytest.raises(ConfigError, match=told):
        config_file(name, wanted)
