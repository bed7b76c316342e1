"""Virtual time passes only when somebody sleeps, and everybody on the clock hears of it."""

from smadrive.clock import MonotonicClock, VirtualClock


def test_sleeping_is_what_makes_virtual_time_pass():
    clock = VirtualClock(start_s=5.0)
    heard = []
    clock.follow(heard.append)
    clock.sleep_until(7.5)
    clock.sleep_until(6.0)  # past: nothing happens
    assert clock.now_s() == 7.5
    assert heard == [7.5]


def test_the_monotonic_clock_reaches_the_time_it_sleeps_until():
    clock = MonotonicClock()
    until_s = clock.now_s() + 1e-3
    clock.sleep_until(until_s)
    assert clock.now_s() >= until_s
