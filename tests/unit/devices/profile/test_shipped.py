"""Each shipped profile: golden frames with the real encoder, and both conversions at the ends of every range."""

import pytest

from smadrive.devices.profile.function_codes import words_of, write_request
from smadrive.devices.profile.profile import load_profile
from smadrive.devices.profile.readings import Context
from smadrive.devices.profile.register_types import RANGES
from smadrive.files.shipped import configs_dir
from smadrive.modbus.framing import rtu

NAMES = sorted(path.stem for path in (configs_dir() / "devices").glob("*.toml"))
PROFILES = {name: load_profile(name) for name in NAMES}
MODELS = {
    f"{name}-{number}": profile if number == 0 else profile.as_variant(profile.variants[number - 1])
    for name, profile in PROFILES.items()
    for number in range(len(profile.variants) + 1)
}
GOLDEN_FRAMES = [(name, golden) for name, profile in PROFILES.items() for golden in profile.golden_frames]
READ_REPLIES = [
    (name, golden) for name, golden in GOLDEN_FRAMES if golden.response and bytes.fromhex(golden.request)[1] <= 4
]


def test_reference_board_is_among_the_shipped_profiles():
    assert "sma-reference" in NAMES


@pytest.mark.parametrize(("name", "golden"), GOLDEN_FRAMES, ids=lambda value: getattr(value, "request", value))
def test_the_encoder_makes_the_golden_frames(name, golden):
    profile = PROFILES[name]
    request = bytes.fromhex(golden.request)
    if request[1] <= 4 or not golden.means:
        assert rtu.seal(request[0], request[1:-2]) == request
        return
    registers = sorted((profile.register(name) for name in golden.means), key=lambda register: register.address)
    values = {profile.register(name).address: value for name, value in golden.means.items()}
    words = [word for register in registers for word in register.codec.encode(values[register.address], "golden")]
    made = write_request(registers[0].table, registers[0].address, words, (request[1],))
    assert rtu.seal(request[0], made.pdu) == request


@pytest.mark.parametrize(("name", "golden"), READ_REPLIES, ids=lambda value: getattr(value, "request", value))
def test_the_decoder_reads_the_golden_replies(name, golden):
    request, response = bytes.fromhex(golden.request), bytes.fromhex(golden.response)
    words = words_of("input", response[3:-2], request[5])
    for meant, value in golden.means.items():
        register = PROFILES[name].register(meant)
        at = register.address - int.from_bytes(request[2:4], "big")
        assert register.codec.decode(words[at : at + register.size]).value == pytest.approx(value)


@pytest.mark.parametrize("profile", MODELS.values(), ids=MODELS)
def test_every_register_converts_both_ways_at_the_ends_of_its_range(profile):
    for name, register in profile.registers.items():
        if register.type == "string":
            continue
        context = Context(scale=0.1) if register.scale_from else Context()
        for raw in RANGES[register.type]:
            words = register.codec.pack(raw)
            value = register.codec.decode(words, context).value
            if value == value:  # noqa: PLR0124 (false for NaN, which is a sentinel or an unknown state)
                assert register.codec.saturated(value, context) == words, name
        for limit in (register.min, register.max):
            if limit is not None and register.writable:
                reading = register.codec.decode(register.codec.encode(limit, name, context), context)
                assert reading.value == pytest.approx(limit, abs=abs(register.scale) / 2), name


def test_no_uncertain_register_is_writable():
    for profile in PROFILES.values():
        for name, register in profile.registers.items():
            assert not (register.writable and register.evidence == "uncertain"), name


@pytest.mark.parametrize("name", NAMES)
def test_every_supply_ends_its_heating_first(name):
    profile = PROFILES[name]
    if profile.profile.role == "supply":
        assert profile.safe_state[0].register_ == profile.role("heater_enable")
        assert profile.safe_state[0].value == 0


def test_overvoltage_protection_of_an_xy7025_reaches_above_its_highest_voltage():
    family = PROFILES["xy-sk-family"]
    (variant,) = (one for one in family.variants if one.match == {"model_id": (0x6500, 0x6500)})
    registers = family.as_variant(variant).registers
    assert registers["ovp"].max > registers["v_set"].max
