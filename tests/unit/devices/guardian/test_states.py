"""The table of the guardian's states, and whole sequences of events, without processes, ports and time."""

import pytest

from smadrive.devices.guardian.states import (
    ATTEMPTS,
    LOOK_AGAIN_S,
    TABLE,
    Action,
    AttemptOutcome,
    DriverSignal,
    GuardianState,
    run,
)

TIMEOUT_S = 3.0


class Script:
    """Returns the signals of the driver and the outcomes of attempts in turn, and records actions and waits.

    An exception in place of an outcome is raised by the attempt.
    """

    def __init__(self, *events):
        self.events = list(events)
        self.actions = []
        self.attempts = []
        self.listened_s = []

    def take(self, kind):
        assert self.events, "the guardian goes on after the end of the story"
        event = self.events.pop(0)
        assert isinstance(event, kind), event
        return event

    def listen(self, within_s):
        self.listened_s.append(within_s)
        return self.take(DriverSignal)

    def attempt(self, state):
        self.attempts.append(state)
        outcome = self.take(AttemptOutcome | Exception)
        if isinstance(outcome, Exception):
            raise outcome
        return outcome

    def run(self):
        run(self.listen, self.attempt, self.actions.append, TIMEOUT_S)
        assert not self.events
        return self


HEARTBEAT, GIVES_WAY, STAND_DOWN, HAND_OVER, SILENCE, CLOSED = DriverSignal
OFF, UNREACHABLE, BARRED, ANOTHER, FLOWS, BUSY, RELIEVED, GONE = AttemptOutcome


@pytest.mark.parametrize("state", [state for state in GuardianState if state is not GuardianState.DONE])
def test_every_event_that_can_occur_has_an_entry(state):
    expected = {*DriverSignal, *AttemptOutcome} if state in ATTEMPTS else {*DriverSignal}
    assert set(TABLE[state]) == expected


def test_every_state_but_the_first_can_be_reached_and_every_one_can_end():
    following = {state: {step.state for step in steps.values()} for state, steps in TABLE.items()}
    assert set().union(*following.values()) == set(GuardianState)
    ends = {GuardianState.DONE}
    for _ in GuardianState:
        ends |= {state for state, after in following.items() if after & ends}
    assert ends == set(GuardianState)


@pytest.mark.parametrize("state", sorted(ATTEMPTS, key=str))
@pytest.mark.parametrize("outcome", [one for one in AttemptOutcome if one not in (OFF, RELIEVED, GONE)])
def test_the_guardian_never_ends_while_heat_may_flow(state, outcome):
    assert TABLE[state][outcome].state not in (GuardianState.DONE, GuardianState.IDLE)


@pytest.mark.parametrize("state", sorted(ATTEMPTS - {GuardianState.WAITING_FOR_DEVICE}, key=str))
def test_ports_are_freed_only_after_a_confirmed_switch_off(state):
    freeing = {event for event, step in TABLE[state].items() if step.action is Action.FREE}
    assert freeing <= {OFF}


def test_driver_behind_a_network_is_killed_only_after_a_whole_silence():
    ending = [
        (state, event) for state in TABLE for event in TABLE[state] if TABLE[state][event].action is Action.END_DRIVER
    ]
    assert ending == [(GuardianState.BARRED, SILENCE)]
    assert {s for s in TABLE for e in TABLE[s] if TABLE[s][e].state is GuardianState.BARRED} <= ATTEMPTS


def test_driver_that_stands_down_and_ends_needs_no_attempt():
    story = Script(HEARTBEAT, HEARTBEAT, STAND_DOWN, SILENCE, CLOSED).run()
    assert story.attempts == []
    assert story.actions == [Action.ECHO, Action.ECHO, Action.FREE]
    assert set(story.listened_s) == {TIMEOUT_S}


def test_heater_of_a_killed_driver_is_switched_off():
    story = Script(HEARTBEAT, CLOSED, OFF).run()
    assert story.attempts == [GuardianState.WAITING_FOR_DEVICE]


def test_driver_that_wakes_gets_its_ports_after_one_more_confirmation():
    story = Script(
        HEARTBEAT, SILENCE, OFF, SILENCE, OFF, GIVES_WAY, OFF, STAND_DOWN, OFF, HEARTBEAT, STAND_DOWN, CLOSED
    ).run()
    assert story.attempts == [
        GuardianState.TAKING_OVER,
        GuardianState.WAITING_FOR_DRIVER,
        GuardianState.GIVEN_WAY,
        GuardianState.RELEASING,
    ]
    assert story.actions == [Action.ECHO, Action.TAKE, Action.FREE, Action.ECHO, Action.FREE]


def test_silent_driver_with_the_only_connection_is_killed():
    story = Script(HEARTBEAT, SILENCE, BARRED, SILENCE, CLOSED, OFF).run()
    assert story.actions == [Action.ECHO, Action.TAKE, Action.END_DRIVER]
    assert story.listened_s == [TIMEOUT_S, TIMEOUT_S, TIMEOUT_S, LOOK_AGAIN_S]


def test_driver_that_gives_up_the_only_connection_is_not_killed():
    story = Script(HEARTBEAT, SILENCE, BARRED, GIVES_WAY, BARRED, SILENCE, BARRED, STAND_DOWN, OFF, CLOSED).run()
    assert Action.END_DRIVER not in story.actions


def test_driver_that_survives_is_killed_again():
    story = Script(HEARTBEAT, SILENCE, BARRED, SILENCE, SILENCE, BARRED, SILENCE, CLOSED, OFF).run()
    assert story.actions.count(Action.END_DRIVER) == 2


@pytest.mark.parametrize("state", sorted(set(TABLE) - {GuardianState.WAITING_FOR_DEVICE}, key=str))
def test_driver_that_hands_over_gets_its_ports_only_after_a_confirmed_switch_off(state):
    assert TABLE[state][HAND_OVER].state is GuardianState.RELEASING


def test_guardian_switches_off_for_a_living_driver_that_cannot_reach_its_device():
    story = Script(HEARTBEAT, HEARTBEAT, HAND_OVER, UNREACHABLE, STAND_DOWN, ANOTHER, SILENCE, OFF, CLOSED).run()
    assert story.attempts == [GuardianState.RELEASING] * 3
    assert story.actions == [Action.ECHO, Action.ECHO, Action.TAKE, Action.FREE]


def test_driver_that_hands_over_behind_a_network_is_not_killed():
    story = Script(HEARTBEAT, HAND_OVER, BARRED, SILENCE, BARRED, SILENCE, BARRED, CLOSED, OFF).run()
    assert Action.END_DRIVER not in story.actions


@pytest.mark.parametrize("last", [OFF, RELIEVED, GONE])
def test_absent_device_is_waited_for_without_limit(last):
    away = [UNREACHABLE, SILENCE, ANOTHER, SILENCE, BUSY, SILENCE, BARRED, SILENCE]
    story = Script(HEARTBEAT, CLOSED, *(away * 5000), last).run()
    assert len(story.attempts) == 20_001


def test_heat_that_returns_while_the_driver_sleeps_is_taken_over_again():
    story = Script(HEARTBEAT, SILENCE, OFF, SILENCE, UNREACHABLE, SILENCE, OFF, CLOSED, OFF).run()
    assert story.attempts == [
        GuardianState.TAKING_OVER,
        GuardianState.WAITING_FOR_DRIVER,
        GuardianState.TAKING_OVER,
        GuardianState.WAITING_FOR_DEVICE,
    ]


@pytest.mark.parametrize("error", [RuntimeError("can't start new thread"), MemoryError(), OSError()])
def test_error_of_an_attempt_does_not_end_the_guardian(error):
    story = Script(HEARTBEAT, SILENCE, error, SILENCE, OFF, CLOSED, error, SILENCE, OFF).run()
    assert story.attempts == [GuardianState.TAKING_OVER] * 2 + [GuardianState.WAITING_FOR_DEVICE] * 2


def test_error_of_an_action_does_not_end_the_guardian():
    def act(action):
        raise MemoryError

    story = Script(HEARTBEAT, SILENCE, BARRED, SILENCE, CLOSED, OFF)
    run(story.listen, story.attempt, act, TIMEOUT_S)
    assert not story.events
