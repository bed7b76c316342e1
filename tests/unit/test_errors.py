"""The message of an error is composed of its parts."""

import pickle

import pytest

from smadrive.errors import ConfigError, ControllerError, ExceptionReply, TripError, free_the_line


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ({}, "too short"),
        ({"where": "a.toml"}, "a.toml: too short"),
        ({"value": "0.5 s"}, "too short (0.5 s)"),
        ({"value": 0.1 + 0.2, "limit": 2}, "too short (0.3, limit 2)"),
        ({"limit": 1e12}, "too short (limit 1e+12)"),
        ({"cure": "raise it"}, "too short. Raise it."),
        ({"cure": "is it in seconds?"}, "too short. Is it in seconds?"),
        ({"cure": "raise it. Is it in seconds?"}, "too short. Raise it. Is it in seconds?"),
        ({"where": "x", "value": 1, "limit": 2, "cure": "raise it."}, "x: too short (1, limit 2). Raise it."),
    ],
)
def test_message_has_the_parts_that_are_given(parts, message):
    assert str(ConfigError("too short", **parts)) == message


@pytest.mark.parametrize(("pid", "shown"), [(None, "`kill PID`"), (77, "`kill 77`")])
def test_cure_for_a_busy_line_names_the_process_if_it_is_known(pid, shown):
    assert shown in free_the_line(pid)


def test_question_needs_no_full_stop():
    assert str(ConfigError("which one?", cure="choose")) == "which one? Choose."


@pytest.mark.parametrize(
    "error",
    [
        ConfigError("too short", where="a.toml", value=0.5, limit=2, cure="raise it"),
        TripError("fault 11: too far", 11, cure="mend it"),
        ExceptionReply("rejected", 2, where="register 5", value=7),
        ControllerError("returned something else", where="Warm", value="None"),
    ],
    ids=lambda error: type(error).__name__,
)
def test_error_crosses_processes_with_its_attributes_and_notes(error):
    error.add_note("the heater is off")
    restored = pickle.loads(pickle.dumps(error))  # noqa: S301
    assert type(restored) is type(error)
    assert str(restored) == str(error)
    assert vars(restored) == vars(error)
