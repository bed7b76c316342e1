"""The conversion of one register: types, both ends of their ranges, sentinels, and wrong descriptions."""

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from smadrive.devices.profile.dependent_registers import context_of
from smadrive.devices.profile.readings import Context
from smadrive.devices.profile.register import Register
from smadrive.errors import ConfigError

RANGES = {
    "uint16": (0, 0xFFFF),
    "int16": (-0x8000, 0x7FFF),
    "uint32": (0, 0xFFFFFFFF),
    "int32": (-0x80000000, 0x7FFFFFFF),
}


def register(**fields):
    return Register.model_validate({"table": "holding", "address": 0, "type": "uint16", "access": "r"} | fields)


@pytest.mark.parametrize("kind", RANGES)
@pytest.mark.parametrize("order", ["big", "little"])
def test_both_ends_of_every_type_survive_the_round_trip(kind, order):
    lowest, highest = RANGES[kind]
    entry = register(type=kind, word_order=order, access="rw", min=lowest, max=highest)
    for value in (lowest, lowest + 1, 0, 1, highest - 1, highest):
        assert entry.codec.decode(entry.codec.encode(value, "r")).value == value


@pytest.mark.parametrize(
    ("kind", "order", "words", "value"),
    [
        ("int16", "big", (0xFFFF,), -1),
        ("int16", "big", (0x8000,), -32768),
        ("uint32", "big", (0x0001, 0x0002), 65538),
        ("uint32", "little", (0x0002, 0x0001), 65538),
        ("int32", "big", (0xFFFF, 0xFFFE), -2),
        ("float32", "little", (0x7C37, 0x428B), 69.743),  # the example in the manual of the OM20
    ],
)
def test_words_of_each_type_decode_to_their_value(kind, order, words, value):
    assert register(type=kind, word_order=order).codec.decode(words).value == pytest.approx(value, abs=5e-4)


@given(st.floats(width=32, allow_nan=False, allow_infinity=False))
def test_float32_is_exact(value):
    entry = register(type="float32", access="rw", min=-3.4e38, max=3.4e38)
    if abs(value) <= 3.4e38:
        assert entry.codec.decode(entry.codec.encode(value, "r")).value == value


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("fields", [{}, {"scale": 0.1, "offset": 3.0}, {"valid_min": -1e9, "valid_max": 1e9}])
def test_a_float_that_is_not_finite_is_an_invalid_reading(value, fields):
    reading = register(type="float32", **fields).codec.decode(struct.unpack(">2H", struct.pack(">f", value)))
    assert math.isnan(reading.value)
    assert reading.invalid is not None


def test_a_scale_that_overflows_makes_an_invalid_reading():
    reading = register(type="uint32", scale=1e300).codec.decode((0xFFFF, 0xFFFF))
    assert math.isnan(reading.value)
    assert reading.invalid is not None


def test_an_invalid_sign_makes_the_value_invalid():
    value = register(sign_register="sign")
    sign = register(type="float32", address=1).codec.decode(struct.unpack(">2H", struct.pack(">f", math.nan)))
    reading = value.codec.decode((7,), context_of(value, {"sign": sign}))
    assert math.isnan(reading.value)
    assert reading.invalid is not None


@given(st.floats(0, 6.5535))
def test_scaling_rounds_to_the_nearest_step(value):
    entry = register(scale=0.0001, access="rw", min=0.0, max=6.5535)
    assert abs(entry.codec.decode(entry.codec.encode(value, "r")).value - value) <= 0.5001e-4


def test_scaling_does_not_truncate():
    assert register(scale=0.1, access="rw", min=0, max=100).codec.encode(0.3, "r") == (3,)
    assert register(scale=0.001, access="rw", min=0, max=10).codec.encode(0.5999999999, "r") == (600,)


def test_an_offset_shifts():
    entry = register(type="uint16", scale=0.5, offset=-40.0)
    assert entry.codec.decode((0,)).value == -40.0
    assert entry.codec.decode((200,)).value == 60.0


@pytest.mark.parametrize("pattern", ["0x8000", "-32768", "32768"])
def test_sentinel_may_be_written_signed_or_unsigned(pattern):
    reading = register(type="int16", scale=0.01, invalid={pattern: "sensor open"}).codec.decode((0x8000,))
    assert math.isnan(reading.value)
    assert reading.invalid == "sensor open"


def test_a_wide_sentinel_follows_the_word_order():
    for order, words in (("big", (0x8000, 0)), ("little", (0, 0x8000))):
        entry = register(type="int32", word_order=order, invalid={"0x80000000": "not fitted"})
        assert entry.codec.decode(words).invalid == "not fitted"
        assert entry.codec.decode(words[::-1]).invalid is None


def test_a_sentinel_outside_the_valid_range_is_accepted():
    entry = register(type="int16", scale=0.1, invalid={"8888": "no probe"}, valid_min=-40.0, valid_max=200.0)
    assert entry.codec.decode((8888,)).invalid == "no probe"


def test_text_is_two_characters_a_word():
    entry = register(type="string", length=4)
    assert entry.codec.decode((0x544B, 0x3420, 0x3134, 0)).words == ("TK4 14",)


def test_dependent_register_takes_sign_scale_and_unit_from_others():
    entry = register(type="int16", scale_from="decimals", unit="degC", unit_from="unit")
    assert entry.codec.decode((2120,), Context(scale=0.1, fahrenheit=True)).value == pytest.approx(100.0)
    assert entry.codec.decode((2120,), Context(sign=-1, scale=0.01)).value == pytest.approx(-21.2)
    assert entry.codec.decode((2120,), Context(problem="asleep")).invalid == "asleep"


@given(st.floats(-100, 100), st.sampled_from([1.0, 0.1, 0.01]), st.booleans())
def test_writing_in_the_devices_unit_and_decimals_comes_back(value, scale, fahrenheit):
    context = Context(scale=scale, fahrenheit=fahrenheit)
    entry = register(type="int16", access="rw", min=-100, max=100, scale_from="decimals", unit_from="unit")
    assert entry.codec.decode(entry.codec.encode(value, "sv", context), context).value == pytest.approx(
        value, abs=0.51 * scale
    )


def test_a_float_that_is_no_number_is_invalid():
    for value in (math.nan, math.inf, -math.inf):
        reading = register(type="float32").codec.decode(struct.unpack(">HH", struct.pack(">f", value)))
        assert math.isnan(reading.value)
        assert "not a number" in reading.invalid


def test_values_outside_the_valid_range_are_invalid():
    entry = register(type="int16", unit="degC", valid_min=-40, valid_max=200)
    assert "-89 degC is below" in entry.codec.decode((0x10000 - 89,)).invalid
    assert "201 degC is above" in entry.codec.decode((201,)).invalid
    assert entry.codec.decode((200,)).invalid is None


def test_enum_and_bits_are_named():
    state = register(enum={"0": "idle", "1": "armed"})
    assert state.codec.decode((1,)).words == ("armed",)
    assert state.codec.decode((7,)).invalid == "unknown state 7"
    assert register(bits={"0": "watchdog", "2": "open"}).codec.decode((0b10101,)).words == ("watchdog", "open", "bit 4")


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_value_that_is_not_finite_is_refused(value):
    with pytest.raises(ConfigError) as error:
        register(access="rw", min=0, max=1).codec.encode(value, "current")
    assert error.value.where == "register 'current'"
    assert error.value.cure == "give a finite number"


@pytest.mark.parametrize("value", [-0.001, 5.001])
def test_writing_beyond_the_limits_is_refused(value):
    with pytest.raises(ConfigError) as error:
        register(scale=0.001, unit="A", access="rw", min=0, max=5).codec.encode(value, "current")
    assert (error.value.where, error.value.value) == ("register 'current'", f"{value:g} A")
    assert error.value.limit == "0 to 5"


def test_writing_an_unknown_state_is_refused():
    with pytest.raises(ConfigError) as error:
        register(access="rw", enum={"0": "off", "1": "on"}).codec.encode(2, "output")
    assert (error.value.where, error.value.value) == ("register 'output'", "2")
    assert error.value.limit == "0 = off, 1 = on"


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ({"access": "rw"}, "needs min and max"),
        ({"access": "rw", "min": 0}, "needs min and max"),
        ({"access": "rw", "min": 0, "max": 100, "scale": 0.001}, "overflows uint16"),
        ({"access": "rw", "min": -1, "max": 1}, "overflows uint16"),
        ({"access": "rw", "min": 2, "max": 1}, "min 2 exceeds max 1"),
        ({"table": "input", "access": "rw", "min": 0, "max": 1}, "cannot be written"),
        ({"scale": 0.0}, "must not be zero"),
        ({"invalid": {"0x10000": "too wide"}}, "does not fit uint16"),
        ({"address": 65536}, "less than or equal to 65535"),
        ({"scal": 1.0}, "Extra inputs"),
        ({"table": "coil"}, "coils and discrete inputs need type 'bool', other tables need another type"),
        ({"type": "bool"}, "coils and discrete inputs need type 'bool', other tables need another type"),
        ({"type": "string"}, "needs a length"),
        ({"length": 2}, "needs a length"),
        ({"type": "string", "length": 2, "access": "rw", "min": 0, "max": 1}, "cannot be written"),
        ({"access": "rw", "min": 0, "max": 1, "sign_register": "sign"}, "cannot be written"),
        ({"access": "rw", "min": 0, "max": 1, "evidence": "uncertain"}, "uncertain"),
        ({"evidence": "rumour"}, "Input should be"),
        ({"access": "w", "min": 0, "max": 1, "nonvolatile": True}, "nonvolatile"),
        ({"invalid": {"0": "none"}, "valid_min": -40}, r"sentinel 0x0 \('none'\) is 0 , inside the valid range"),
        ({"invalid": {"500": "none"}, "valid_max": 50.0, "scale": 0.1}, "inside the valid range"),
        ({"invalid": {"5": "none"}, "access": "rw", "min": 0, "max": 10}, "inside the valid range"),
    ],
)
def test_inconsistent_register_is_refused(fields, says):
    with pytest.raises(ValidationError, match=says):
        register(**fields)
