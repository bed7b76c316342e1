"""A controller of the user: what is refused before the run, and during it."""

from fractions import Fraction
from math import inf, isnan, nan

import numpy as np
import pytest

from smadrive.control.controllers.interface import Command
from smadrive.errors import ConfigError, ControllerError
from smadrive.measurement import Measurement
from smadrive.scripting.loop.own_controller import OwnController, Pace, check_controller

LIMIT_A = 0.6
SAMPLE = Measurement(0.0, 25.0, 0.0, 0.0)


class Returns:
    """A controller that returns what it is given."""

    def __init__(self, value):
        self.value = value

    def update(self, time_s, measurement, dt_s):
        return self.value


class Unprintable:
    def __repr__(self):
        raise ZeroDivisionError


class Timed(Returns):
    duration_s = 5.0


@pytest.mark.parametrize(
    ("controller", "duration_s", "where"),
    [
        (3.0, 5.0, "controller"),
        (None, 5.0, "controller"),
        (Returns, 5.0, "controller"),
        (lambda time_s: 0.0, 5.0, "controller"),
        (Returns(1), None, "duration_s"),
        (Returns(1), 0.0, "duration_s"),
        (Returns(1), -1.0, "duration_s"),
        (Returns(1), nan, "duration_s"),
        (Returns(1), "long", "duration_s"),
        (Returns(1), "5", "duration_s"),
        (Returns(1), True, "duration_s"),
        (Returns(1), Unprintable(), "duration_s"),
    ],
)
def test_what_is_no_controller_is_refused_in_one_sentence(controller, duration_s, where):
    with pytest.raises(ConfigError) as refused:
        check_controller(controller, duration_s)
    assert refused.value.where == where
    assert refused.value.cure
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(("controller", "duration_s"), [(Returns(1), 5), (Timed(1), None), (Returns(1), inf)])
def test_controller_with_a_duration_is_accepted(controller, duration_s):
    check_controller(controller, duration_s)


@pytest.mark.parametrize(
    "value",
    [None, 0.2, "0.2", {"commanded_a": 0.2}, (0.2,), Unprintable()]
    + [Command(current) for current in ("much", "0.1", True, None, [0.1], np.array([0.1]), 0.1j)]
    + [Command(0.1, setpoint_mm="2")],
)
def test_what_is_no_command_is_an_error_that_names_it(value):
    with pytest.raises(ControllerError) as caught:
        OwnController(Returns(value), 5.0, LIMIT_A).update(0.0, SAMPLE, 0.05)
    assert caught.value.where.startswith("Returns")
    assert len(str(caught.value)) < 200


@pytest.mark.parametrize("current_a", [nan, inf, -inf])
def test_current_that_is_not_finite_is_an_error(current_a):
    with pytest.raises(ControllerError, match="not a finite number"):
        OwnController(Returns(Command(current_a)), 5.0, LIMIT_A).update(0.0, SAMPLE, 0.05)


@pytest.mark.parametrize("current_a", [20.1 * LIMIT_A, 300.0])
def test_current_far_beyond_the_limit_is_an_error(current_a):
    with pytest.raises(ControllerError) as caught:
        OwnController(Returns(Command(current_a)), 5.0, LIMIT_A).update(0.0, SAMPLE, 0.05)
    assert (caught.value.value, caught.value.limit) == (f"{current_a:g} A", "current_max_a = 0.6 A")


@pytest.mark.parametrize("current_a", [-300.0, 0.7, 19.9 * LIMIT_A])
def test_current_outside_of_the_limits_is_left_to_the_clamp(current_a):
    assert OwnController(Returns(Command(current_a)), 5.0, LIMIT_A).update(0.0, SAMPLE, 0.05).commanded_a == current_a


@pytest.mark.parametrize("number", [np.float32(0.25), np.array(0.25), Fraction(1, 4), 0.25])
def test_every_kind_of_number_becomes_a_float(number):
    command = OwnController(Returns(Command(number, setpoint_mm=number)), 5.0, LIMIT_A).update(0.0, SAMPLE, 0.05)
    assert command[:3:2] == (0.25, 0.25)
    assert {type(value) for value in command} == {float}
    assert isnan(command.setpoint_c)


def test_errors_of_the_controller_pass_unchanged():
    controller = OwnController(object(), 5.0, LIMIT_A)
    with pytest.raises(AttributeError):
        controller.update(0.0, SAMPLE, 0.05)


def test_controller_that_calls_exit_does_not_end_the_process_without_a_word():
    class Leaves:
        def update(self, time_s, measurement, dt_s):
            raise SystemExit

    with pytest.raises(ControllerError, match="update called exit"):
        OwnController(Leaves(), 5.0, LIMIT_A).update(0.0, SAMPLE, 0.05)


def test_duration_follows_the_controller_unless_it_is_given():
    timed = Timed(1)
    own, fixed = OwnController(timed, None, LIMIT_A), OwnController(timed, 7.0, LIMIT_A)
    timed.duration_s = 6.0
    assert (own.duration_s, fixed.duration_s) == (6.0, 7.0)


def updated(times_s, pace):
    """Return a controller whose updates begin and end at `times_s`, after these updates."""
    clock = iter(times_s)
    own = OwnController(Returns(Command(0.1)), 5.0, LIMIT_A, pace=pace, now_s=lambda: next(clock))
    for _ in range(len(times_s) // 2):
        own.update(0.0, SAMPLE, 0.05)
    return own


def test_update_that_takes_longer_than_the_rig_waits_is_an_error_that_names_the_period():
    with pytest.raises(ControllerError) as caught:
        updated([0.0, 0.4], Pace(0.05, 0.3))
    assert (caught.value.where, caught.value.value) == ("Returns", "0.4 s")
    assert caught.value.limit.startswith("0.3 s")
    assert caught.value.limit.endswith("the period is 0.05 s")
    assert "rate_hz" in caught.value.cure


@pytest.mark.parametrize(
    ("took_s", "is_virtual", "caveats"), [(0.2, False, 1), (0.04, False, 0), (0.4, True, 1), (0.2, True, 0)]
)
def test_slow_update_is_a_caveat_of_the_run(took_s, is_virtual, caveats):
    own = updated([0.0, took_s, 1.0, 1.0], Pace(0.05, 0.3, is_virtual))
    assert own.slowest_s == took_s
    assert len(own.caveats) == caveats
    assert all(f"{took_s:g} s" in caveat and "0.05 s" in caveat for caveat in own.caveats)


def test_update_with_two_arguments_is_refused_before_the_run():
    class Short:
        def update(self, time_s, measurement):
            return Command(0.0)

    with pytest.raises(ConfigError) as refused:
        check_controller(Short(), 5.0)
    assert "dt_s" in refused.value.cure
