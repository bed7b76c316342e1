"""Shipped profiles load. A profile that could lead to a wrong value or a harmful write is an error."""

from contextlib import nullcontext

import pytest

from smadrive.devices.profile.profile import load_profile
from smadrive.errors import ConfigError
from smadrive.files.shipped import configs_dir

SHIPPED = sorted((configs_dir() / "devices").glob("*.toml"))
REFERENCE = (configs_dir() / "devices" / "sma-reference.toml").read_text(encoding="utf-8")


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_every_shipped_profile_loads_by_name_and_by_path(path):
    assert load_profile(path.stem) == load_profile(path)
    assert load_profile(path.stem).profile.id == path.stem


def test_an_unknown_name_lists_the_known():
    with pytest.raises(ConfigError, match=r"'sma': .*devices .*sma-reference"):
        load_profile("sma")


def test_all_registers_of_the_reference_map_are_holding_registers():
    profile = load_profile("sma-reference")
    assert {register.table for register in profile.registers.values()} == {"holding"}


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        (
            "[timing]",
            "[timing]\nrespons_timeout_ms = 1",
            r"timing\.respons_timeout_ms: .*did you mean 'response_timeout_ms'",
        ),
        ("[roles]", "[roles]\ntemperatur = 'temperature'", r"roles\.temperatur: .*did you mean 'temperature'"),
        ("[registers.state]", "[registers.state]\nenums = {}", r"registers\.state\.enums: .*did you mean 'enum'"),
        ("address = 17\n", "address = 16\n", r"registers\.\w+\.address 16 overlaps registers\.\w+, which ends at 16"),
        ("address = 26\n", "address = 25\n", r"registers\.sample_counter\.address 25 overlaps registers\.displacement"),
        (
            "max = 10.0",
            "max = 66.0",
            r"registers\.watchdog_s: 66 s is raw 66000, which overflows uint16 \(0 to 65535\)",
        ),
        ("min = 0.05\nmax = 10.0\n", "", r"registers\.watchdog_s: .*needs min and max"),
        (
            "[[safe_state]]",
            "[[forbidden]]\ntable='holding'\nfirst=30\nlast=33\nreason='x'\n[[safe_state]]",
            r"'rw' at address 32 writes into the forbidden range 30 to 33 \(x\): make it access = 'r'",
        ),
        (
            'temperature = "temperature"',
            'temperature = "temprature"',
            r"roles\.temperature names the unknown register 'temprature'",
        ),
        (
            'register = "heater_enable"\nvalue = 0',
            'register = "heater_enable"\nvalue = 7',
            r"safe_state: register 'heater_enable'.*\(7,",
        ),
        (
            'register = "heater_enable"\nvalue = 0',
            'register = "arm"\nvalue = 0',
            r"safe_state.register 'arm' has access 'w'.*read-back",
        ),
        (
            'register = "heater_enable"\nvalue = 0',
            'register = "heater_enabl"\nvalue = 0',
            r"did you mean 'heater_enable'",
        ),
        (
            'register = "device_id"',
            'register = "devise_id"',
            r"identify.register names the unknown register 'devise_id'; did you mean 'device_id'",
        ),
        (
            REFERENCE[REFERENCE.index("[[safe_state]]") :],
            "",
            r"a heater needs \[\[safe_state\]\]",
        ),
        ("unit_id = 1", "unit_id = 248", r"serial\.unit_id: .*247"),
        ("schema = 1", "schema = 2", r"schema"),
    ],
)
def test_wrong_entry_is_refused_with_file_key_and_cure(tmp_path, old, new, says):
    assert old in REFERENCE
    path = tmp_path / "bad.toml"
    path.write_text(REFERENCE.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(ConfigError, match=says) as error:
        load_profile(path)
    assert str(error.value).startswith(f"{path}: ")
    assert "\n" not in str(error.value)


def test_a_role_that_is_not_bound_is_named(tmp_path):
    path = tmp_path / "bare.toml"
    path.write_text(REFERENCE.replace('watchdog_s = "watchdog_s"\n', "", 1), encoding="utf-8")
    with pytest.raises(ConfigError, match="'watchdog_s'") as error:
        load_profile(path).role("watchdog_s")
    assert error.value.where == "profile 'sma-reference'"
    assert error.value.cure == 'name its register in [roles]: watchdog_s = "REGISTER"'


def test_changed_file_is_loaded_again(tmp_path):
    file = tmp_path / "reader.toml"
    text = (configs_dir() / "devices" / "autonics-tk.toml").read_text(encoding="utf-8")
    assert "unit_id = 1\n" in text
    for unit_id in (1, 2, 300, 1):
        file.write_text(text.replace("unit_id = 1\n", f"unit_id = {unit_id}\n"), encoding="utf-8")
        with pytest.raises(ConfigError) if unit_id == 300 else nullcontext():
            assert load_profile(file).unit_id == unit_id
