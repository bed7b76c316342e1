"""docs/sma-reference.md agrees with the profile and the simulated board."""

import re

import pytest

from smadrive.devices.profile.profile import load_profile
from smadrive.files.shipped import configs_dir

DOCUMENT = (configs_dir().parent / "docs" / "sma-reference.md").read_text(encoding="utf-8")
PROFILE = load_profile("sma-reference")
DIALOGUE = re.findall(r"^\| ((?:[0-9A-F]{2} )+[0-9A-F]{2}) \| ((?:[0-9A-F]{2} ?)+) \|", DOCUMENT, re.MULTILINE)
MAP = re.findall(r"^\| (\d+)(?:–\d+)? \| (\w+) \| (\w+) \|[^|]*\| (\w+) \|", DOCUMENT, re.MULTILINE)
BITS = re.findall(r"^\| (\d+) \| (\w+) \| ", DOCUMENT, re.MULTILINE)


def test_board_answers_like_the_documented_dialogue(simulated):
    assert len(DIALOGUE) == 18
    for request, reply in DIALOGUE:
        ((_, answer),) = simulated.line.receive(bytes.fromhex(request), 0.0)
        assert answer.hex(" ").upper() == reply, request


def test_documented_map_agrees_with_the_profile():
    documented = {name: (int(address), access) for address, name, _, access in MAP if name in PROFILE.registers}
    assert documented == {name: (register.address, register.access) for name, register in PROFILE.registers.items()}


@pytest.mark.parametrize("register", ["faults", "limits"])
def test_every_bit_is_documented(register):
    for bit, name in PROFILE.register(register).bits.items():
        assert (str(bit), name) in BITS
