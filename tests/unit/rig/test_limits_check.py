"""Implausible limits of a rig for its wire are an error before a port is opened."""

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


def error_of(limits, excitation=None, wire=SUPPLY.wire):
    with pytest.raises(ConfigError) as caught:
        Rig(rig_with(limits, excitation, wire))
    assert caught.value.where == f"rig '{SUPPLY.name}'"
    return caught.value


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
    ("limits", "excitation", "key", "value", "limit"),
    [
        (KELVIN, {"low_c": 313.0, "high_c": 363.0}, "temperature_max_c", "378 °C", "160 °C"),
        ({"temperature_max_c": 408.0}, {}, "temperature_max_c", "408 °C", "160 °C"),
        ({"temperature_max_c": 161.0}, {}, "temperature_max_c", "161 °C", "160 °C"),
        ({"current_max_a": 400.0}, {}, "current_max_a", "400 A", None),
        ({"current_max_a": 0.0002}, {}, "current_max_a", "0.0002 A", "at least 0.029 A"),
        ({"voltage_max_v": 0.5}, {}, "voltage_max_v", "0.5 V", None),
        ({"voltage_max_v": 60.0}, {}, "voltage_max_v", "60 V", None),
        ({"voltage_max_v": 9000.0}, {}, "voltage_max_v", "9000 V", None),
    ],
)
def test_implausible_limit_is_an_error_with_value_and_limit(limits, excitation, key, value, limit):
    error = error_of(limits, excitation)
    assert f"limits.{key}" in error.what
    assert error.value == value
    assert error.limit == limit if limit else error.limit
    assert error.cure


@pytest.mark.parametrize("plan", ["nested", "forc"])
def test_excitation_that_does_not_fit_into_its_time_is_an_error_before_a_port_is_opened(plan):
    with pytest.raises(ConfigError) as caught:
        Rig(rig_with({}, {"plan": plan, "duration_s": 100.0}))
    assert (caught.value.where, caught.value.value) == ("excitation.duration_s", "100 s")
    shortest_s = float(caught.value.cure.split()[-1])
    rig = Rig(rig_with({}, {"plan": plan, "duration_s": shortest_s}))
    assert shortest_s - 1.0 < rig.excitation(rig.data_sheet.ambient_c).duration_s <= shortest_s


@pytest.mark.parametrize(
    ("limits", "hint"),
    [
        (KELVIN, "378 K is 105 °C"),
        ({"temperature_max_c": 408.0}, "408 K is 135 °C"),
        ({"current_max_a": 400.0}, "in amperes"),
        ({"current_max_a": 0.0002}, "in amperes"),
        ({"voltage_max_v": 0.5}, "about 8.2"),
        ({"voltage_max_v": 60.0}, "about 8.2"),
        ({"voltage_max_v": 9000.0}, "in volts"),
    ],
)
def test_cure_suggests_the_likely_unit_or_value(limits, hint):
    assert hint in error_of(limits, {"low_c": 40.0, "high_c": 105.0}).cure


def test_cure_suggests_kelvin_only_where_the_value_fits():
    assert error_of({"temperature_max_c": 161.0}).cure == "lower it"


@pytest.mark.parametrize(
    "limits",
    [
        {"temperature_max_c": 160.0},
        {"voltage_max_v": 5.0},
        {"voltage_max_v": 24.0},
        {"current_max_a": 0.1, "temperature_max_c": 121.0},
        {"current_max_a": 0.1, "voltage_max_v": 15.0},
        {"current_max_a": 0.6},
        {"current_max_a": 0.03, "voltage_max_v": 1.0},
    ],
)
def test_careful_and_generous_limits_are_accepted(limits):
    Rig(rig_with(limits))


def test_wire_file_without_a_highest_temperature_has_that_of_nickel_titanium(wire_with):
    wire = wire_with(temperature_max_c=None)
    Rig(rig_with({"temperature_max_c": 200.0}, wire=wire))
    error = error_of({"temperature_max_c": 201.0}, wire=wire)
    assert error.limit == "200 °C"
    assert "set temperature_max_c in the wire file" in error.cure


def test_limit_below_the_ambient_temperature_is_an_error(wire_with):
    error = error_of({"current_max_a": 400.0}, wire=wire_with(ambient_c=140.0))
    assert (error.value, error.limit) == ("135 °C", "140 °C")


def test_wire_file_of_a_hotter_alloy_allows_a_higher_limit(wire_with):
    Rig(rig_with({"temperature_max_c": 300.0}, wire=wire_with(temperature_max_c=320.0)))


def test_wire_file_in_kelvin_is_an_error(wire_with):
    with pytest.raises(ConfigError, match="temperature_max_c"):
        Rig(rig_with({}, wire=wire_with(temperature_max_c=433.0)))


@pytest.mark.parametrize("path", sorted((configs_dir() / "wires").glob("*.toml")), ids=lambda path: path.stem)
def test_shipped_wire_has_a_highest_temperature(path):
    assert "temperature_max_c" in load_data_sheet(str(path)).model_fields_set
