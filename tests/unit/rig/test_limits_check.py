"""Limits of a rig that are none for its wire are refused, before a port is opened."""

import pytest
import tomlkit

from smadrive.errors import ConfigError
from smadrive.files.kinds import WIRE
from smadrive.files.shipped import config_file, configs_dir
from smadrive.rig.config import RigConfig, load_rig
from smadrive.rig.rig import Rig
from smadrive.wire.data_sheet import load_data_sheet

SUPPLY = load_rig("bench-supply")
KELVIN = {"temperature_max_c": 378.0, "current_max_a": 0.65, "voltage_max_v": 13.0}


def rig_with(limits, excitation=None, wire=SUPPLY.wire):
    document = SUPPLY.model_dump(exclude_none=True, exclude={"feedback"}) | {"wire": str(wire)}
    document["limits"] |= limits
    document["excitation"] |= excitation or {}
    return RigConfig.model_validate(document)


@pytest.fixture
def wire_with(tmp_path):
    def write(**changes):
        document = tomlkit.parse(config_file(SUPPLY.wire, WIRE).read_text(encoding="utf-8"))
        for key, value in changes.items():
            if value is None:
                del document[key]
            else:
                document[key] = value
        path = tmp_path / "wire.toml"
        path.write_text(tomlkit.dumps(document), encoding="utf-8")
        return path

    return write


@pytest.mark.parametrize(
    ("limits", "excitation", "told"),
    [
        (
            KELVIN,
            {"low_c": 313.0, "high_c": 363.0},
            "= 378 °C is more than .* 160 °C by temperature_max_c of its wire file: lower it. Is it in kelvin",
        ),
        ({"temperature_max_c": 408.0}, {}, r"Is it in kelvin\? 408 K are 135 °C"),
        ({"temperature_max_c": 161.0}, {}, "lower it.$"),
        ({"current_max_a": 400.0}, {}, "is it in amperes?"),
        ({"voltage_max_v": 0.5}, {}, r"too little to drive .*, which takes 6\.6 V; .* set it to some 8\.2"),
        ({"voltage_max_v": 60.0}, {}, r"= 60 is no limit for .* set it to some 8\.2; is it in volts"),
        ({"voltage_max_v": 9000.0}, {}, "is it in volts"),
    ],
)
def test_what_is_no_limit_for_the_wire_is_refused_with_value_limit_and_cure(limits, excitation, told):
    with pytest.raises(ConfigError, match=told):
        Rig(rig_with(limits, excitation))


@pytest.mark.parametrize(
    "limits",
    [
        {"temperature_max_c": 160.0},
        {"voltage_max_v": 5.0},
        {"voltage_max_v": 24.0},
        {"current_max_a": 0.1, "temperature_max_c": 121.0},
        {"current_max_a": 0.1, "voltage_max_v": 15.0},
        {"current_max_a": 0.6},
    ],
)
def test_careful_and_generous_ones_are_taken(limits):
    Rig(rig_with(limits))


def test_a_wire_file_that_tells_no_highest_temperature_has_that_at_which_nickel_titanium_ages(wire_with):
    wire = wire_with(temperature_max_c=None)
    Rig(rig_with({"temperature_max_c": 200.0}, wire=wire))
    with pytest.raises(
        ConfigError, match=r"200 °C .* tells no temperature_max_c: .* or set temperature_max_c in the wire file"
    ):
        Rig(rig_with({"temperature_max_c": 201.0}, wire=wire))


def test_a_limit_below_the_surroundings_is_refused(wire_with):
    with pytest.raises(ConfigError, match=r"= 135 °C is not above ambient_c = 140 °C"):
        Rig(rig_with({"current_max_a": 400.0}, wire=wire_with(ambient_c=140.0)))


def test_an_alloy_that_transforms_hotter_says_so(wire_with):
    Rig(rig_with({"temperature_max_c": 300.0}, wire=wire_with(temperature_max_c=320.0)))


def test_a_wire_file_in_kelvin_is_refused_too(wire_with):
    with pytest.raises(ConfigError, match="temperature_max_c"):
        Rig(rig_with({}, wire=wire_with(temperature_max_c=433.0)))


@pytest.mark.parametrize("path", sorted((configs_dir() / "wires").glob("*.toml")), ids=lambda path: path.stem)
def test_a_shipped_wire_tells_what_it_stands(path):
    assert "temperature_max_c" in load_data_sheet(str(path)).model_fields_set
