"""Loading fails for wrong entries in profiles with families, several tables or golden frames."""

from math import isnan

import pytest

from smadrive.devices.profile.profile import load_profile
from smadrive.errors import ConfigError
from smadrive.files.shipped import configs_dir

DEVICES = configs_dir() / "devices"
AMPERES = 'unit = "A"\naccess = "rw"'
OUTPUT_OFF = 'register = "output"\nvalue = 0'
CURRENT_ZERO = '[[safe_state]]\nregister = "i_set"\nvalue = 0.0\n'
WRITABLE = 'access = "rw"\nmin = 0\nmax = 1\nevidence = "two"'


@pytest.mark.parametrize(
    ("device", "old", "new", "says"),
    [
        ("riden-rd60xx", "power = { scale = 0.001 } }", "power = { scle = 0.1 } }", r"power.scle: .*mean 'scale'"),
        (
            "riden-rd60xx",
            "power = { scale = 0.001 } }",
            "pover = { scale = 0.1 } }",
            r"registers.pover is not a register",
        ),
        ("riden-rd60xx", "max = 30.0 }", "max = 3000.0 }", r"variants: registers.i_set: .*overflows uint16"),
        ("riden-rd60xx", "{ model_id = [60241, 60249] }", "{ model_id = [60180, 60249] }", "match the same device"),
        ("riden-rd60xx", 'register = "serial_number"', 'register = "output"', "output can be written"),
        ("riden-rd60xx", "current_range = [0, 0]", "current_rnge = [0, 0]", r"variants.match .*mean 'current_range'"),
        ("riden-rd60xx", 'sign_register = "temp_int_sign"', 'sign_register = "sign"', r"temp_int names the unknown"),
        ("riden-rd60xx", "E8 0F", "E8 0E", r"wrong CRC; the right one is E8 0F"),
        ("riden-rd60xx", "means = { output = 1 }", "means = { output = 0 }", r"output is 1.0 in these frames, not 0"),
        ("riden-rd60xx", "means = { output = 1 }", "means = { outpt = 0 }", r"unknown register 'outpt'"),
        ("riden-rd60xx", OUTPUT_OFF, OUTPUT_OFF.replace("0", "1"), "safe_state must set 'output' to 0"),
        ("riden-rd60xx", OUTPUT_OFF, OUTPUT_OFF.replace("output", "keypad_lock"), "safe_state must set 'output' to 0"),
        ("juntek-dpm86xx", CURRENT_ZERO, "", "safe_state must set 'i_set' to 0"),
        (
            "hanmatek-hm30x",
            CURRENT_ZERO,
            CURRENT_ZERO + CURRENT_ZERO.replace("0.0", "0.1"),
            "safe_state must set 'i_set' to 0",
        ),
        ("sma-reference", '"heater_enable"\nvalue = 0', '"heater_enable"\nvalue = 1', "must set 'heater_enable' to 0"),
        ("juntek-dpm86xx", "B7 6B", "B7 6C", "wrong CRC"),
        ("juntek-dpm86xx", "01 10 00 00 00 02 41 C8", "01 06 00 00 09 60 8F B2", "does not answer"),
        ("juntek-dpm86xx", f"scale = 0.001\n{AMPERES}", f"scale = 0.01\n{AMPERES}", "i_set is"),
        ("juntek-dpm86xx", "[3, 6, 16]", "[4, 6, 16]", "none of timing.function_codes .* reads table 'holding'"),
        ("juntek-dpm86xx", "[3, 6, 16]", "[3, 17]", "function 17"),
        ("hanmatek-hm30x", 'access = "r"\nevidence = "uncertain"', WRITABLE, "writes 2 addr"),
        ("xy-sk-family", 'write = "ovp"', 'write = "opv"', "write_order.write names the unknown register 'opv'"),
        ("xy-sk-family", 'before = "v_set"', 'before = "*"', r"before '\*' needs a value"),
        ("xy-sk-family", 'before = "v_set"', 'before = "output"', "safe_state.register 'output'"),
        ("delta-dtb", "value = 1\n", "value = 2\n", r"write_order: register 'comm_write_enable': .*\(2, raw 2"),
        ("delta-dtb", 'write = "comm_write_enable"', 'write = "pv"', "'pv' has access 'r'"),
        ("autonics-tk", 'enum = { 0 = "1", 1 = "0.1"', 'enum = { 0 = "one", 1 = "0.1"', r"registers\.pv\.scale_from"),
        ("autonics-tk", 'unit = "degC"', 'unit = "K"', "unit_from needs unit = 'degC'"),
        ("baumer-om20", "address = 209", "address = 213", r"block 'measurement' cannot be read in one request"),
        ("baumer-om20", "[timing]", "[timing]\nmax_read_registers = 12", r"(has 16 words|cannot be read in one)"),
        ("baumer-om20", "quality = [0, 1]", "qualty = [0, 1]", r"unknown register 'qualty'; did you mean 'quality'"),
        ("adam-6018", "[tcp]\nunit_id = 1", "", r"'modbus-tcp' needs the table \[tcp\]"),
        ("adam-6018", 'choice = "J"', 'choice = "T"', "a choice occurs twice"),
        ("adam-6018", 'choice = "J"', 'choice = "J"\nmatch = { tc_0 = [0, 1] }', "either match .* or choice"),
        ("adam-6018", "address = 16", "address = 65530", "ends at 65537, beyond 65535"),
    ],
)
def test_wrong_entry_is_refused(tmp_path, device, old, new, says):
    text = (DEVICES / f"{device}.toml").read_text(encoding="utf-8")
    assert old in text
    path = tmp_path / "bad.toml"
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(ConfigError, match=says) as error:
        load_profile(path)
    assert "\n" not in str(error.value)


def test_channels_may_stand_apart_but_not_overlap(tmp_path):
    text = (DEVICES / "adam-6018.toml").read_text(encoding="utf-8")
    path = tmp_path / "apart.toml"
    path.write_text(text.replace("stride = 1", "stride = 3", 1), encoding="utf-8")
    assert load_profile(path).register("tc_7").address == 21
    path.write_text(text.replace('type = "uint16"', 'type = "uint32"', 1), encoding="utf-8")
    with pytest.raises(ConfigError, match=r"registers\.tc_1\.address 1 overlaps registers\.tc_0"):
        load_profile(path)


@pytest.mark.parametrize("choice", ["", ":J", ":T", ":E"])
@pytest.mark.parametrize("raw", [0, 65535])
def test_end_of_the_range_of_a_thermocouple_module_is_no_temperature(choice, raw):
    """An open or reversed thermocouple, too, shows an end of the range."""
    reading = load_profile(f"adam-6018{choice}").register("tc_5").codec.decode((raw,))
    assert isnan(reading.value)
    assert reading.invalid is not None


def test_a_choice_holds_for_every_channel_and_a_wrong_one_is_named():
    assert load_profile("adam-6018:T").register("tc_5").codec.decode((1,)).value == pytest.approx(
        -100.0 + 500.0 / 65535
    )
    assert load_profile("adam-6018").register("tc_5").codec.decode((65534,)).value == pytest.approx(1370.0, abs=0.03)
    with pytest.raises(ConfigError) as error:
        load_profile("adam-6018:K")
    assert error.value.where == "profile 'adam-6018'"
    assert error.value.cure == "known are: E, J, T"
