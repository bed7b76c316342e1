"""A mistyped value of an option is an error that names the option, the value and the cure, before anything runs."""

import pytest

from smadrive.cli.parsing.app import command_line
from smadrive.errors import ConfigError

HEAT = ("heat", "in-process")
IDENTIFY = ("identify", "wire.csv", "-o", "wire.json")
CALIBRATE = ("calibrate", "in-process", "temperature", "--point", "1")
NUMBERS = [
    (*HEAT, "--for", "1", "--current"),
    (*HEAT, "--for", "1", "--temperature"),
    (*HEAT, "--current", "0.1", "--for"),
    ("watch", "in-process", "--for"),
    (*CALIBRATE, "--for"),
    (*CALIBRATE, "--pressure-hpa"),
    (*CALIBRATE, "--value-uncertainty"),
    ("invert", "wire.json", "wire.csv", "-o", "out.csv", "--start"),
]


@pytest.mark.parametrize("value", ["nan", "inf", "-inf", "0,5", "2s", ""])
@pytest.mark.parametrize("arguments", NUMBERS, ids=lambda arguments: f"{arguments[0]} {arguments[-1]}")
def test_value_that_is_not_a_finite_number_is_rejected(arguments, value):
    with pytest.raises(ConfigError) as error:
        command_line(arguments[0])([*arguments, value])
    assert (error.value.where, error.value.value) == (arguments[-1], value)
    assert error.value.cure
    if "," in value:
        assert error.value.cure == "write 0.5"


@pytest.mark.parametrize(
    ("arguments", "where", "value", "cure"),
    [
        ((*IDENTIFY, "--kind", "duhm"), "--kind", "duhm", "did you mean 'duhem'?"),
        ((*IDENTIFY, "--sets", "7,5"), "--sets", "7,5", "write 7.5"),
        ((*IDENTIFY, "--sets", "7.5"), "--sets", "7.5", "write a number such as 2"),
        (
            ("calibrate", "in-process", "temprature", "--point", "1"),
            "SENSOR",
            "temprature",
            "did you mean 'temperature'?",
        ),
        (
            ("calibrate", "in-process", "force", "--point", "1"),
            "SENSOR",
            "force",
            "known are: displacement, temperature",
        ),
    ],
)
def test_mistyped_value_is_rejected_with_its_cure(arguments, where, value, cure):
    with pytest.raises(ConfigError) as error:
        command_line(arguments[0])(arguments)
    assert (error.value.where, error.value.value, error.value.cure) == (where, value, cure)
