"""The states of a guardian, as a table without processes, ports or time.

    IDLE                 the driver lives, nothing heats
    WATCHING             the driver heats; its silence means that it no longer can
    TAKING_OVER          the driver is silent; the heater is not confirmed off
    BARRED               the same behind a network, where the driver may hold the only connection
    ENDING_DRIVER        a driver that holds the only connection has been ended; its end is awaited
    WAITING_FOR_DRIVER   the heater is confirmed off, again and again: the driver may wake and send one last command
    GIVEN_WAY            the driver woke and let its connections go
    RELEASING            the driver waits for its ports: once more confirmed off, it gets them
    WAITING_FOR_DEVICE   the driver has ended; the heater is not confirmed off since then
    DONE                 the guardian ends

In the states of `ATTEMPTS` the guardian tries to switch the heater off, then listens to the driver; in the others it
only listens. Every event of the pipe and of an attempt has an entry in every state where it can occur.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum, auto
from typing import NamedTuple

LOOK_AGAIN_S = 0.5


class State(Enum):
    """See the head of this file."""

    IDLE = auto()
    WATCHING = auto()
    TAKING_OVER = auto()
    BARRED = auto()
    ENDING_DRIVER = auto()
    WAITING_FOR_DRIVER = auto()
    GIVEN_WAY = auto()
    RELEASING = auto()
    WAITING_FOR_DEVICE = auto()
    DONE = auto()


class Heard(Enum):
    """What the driver's pipe brings."""

    BEAT = auto()
    GIVES_WAY = auto()
    REST = auto()
    SILENCE = auto()
    CLOSED = auto()


class Outcome(Enum):
    """What an attempt to switch the heater off comes to."""

    CONFIRMED = auto()
    UNREACHABLE = auto()
    UNREACHABLE_REMOTE = auto()
    """As UNREACHABLE, behind a network."""
    ANOTHER_DEVICE = auto()
    BUSY = auto()
    """Another program has the line."""
    RELIEVED = auto()
    """A new driver or `smadrive off` has confirmed the device off."""
    GONE = auto()
    """A pseudo-terminal that has ended: it never comes back."""


Event = Heard | Outcome


class Action(Enum):
    """What the guardian does on its way into the next state."""

    ECHO = auto()
    FREE = auto()
    """Tell the driver that it has its ports."""
    TAKE = auto()
    """Tell the driver that its ports are taken."""
    END_DRIVER = auto()


class Step(NamedTuple):
    """The next state, and what is done on the way."""

    state: State
    action: Action | None = None


ATTEMPTS = frozenset(
    {State.TAKING_OVER, State.WAITING_FOR_DRIVER, State.GIVEN_WAY, State.RELEASING, State.WAITING_FOR_DEVICE}
)
PATIENT = frozenset({State.IDLE, State.WATCHING, State.BARRED})
"""In these a driver may be silent for `timeout_s`; in the others the guardian looks again soon."""

_TAKING_OVER, _WAITING = Step(State.TAKING_OVER), Step(State.WAITING_FOR_DEVICE)
_DONE, _BARRED = Step(State.DONE), Step(State.BARRED)

_WITH_A_SILENT_DRIVER: dict[Event, Step] = {
    Heard.BEAT: _TAKING_OVER,
    Heard.GIVES_WAY: Step(State.GIVEN_WAY),
    Heard.REST: Step(State.RELEASING),
    Heard.SILENCE: _TAKING_OVER,
    Heard.CLOSED: _WAITING,
}
_ATTEMPTED: dict[Event, Step] = {
    **dict.fromkeys(Outcome, _TAKING_OVER),
    Outcome.CONFIRMED: Step(State.WAITING_FOR_DRIVER),
    Outcome.UNREACHABLE_REMOTE: _BARRED,
}


def _stays(state: State, *events: Event) -> dict[Event, Step]:
    return {event: Step(state) for event in events}


TABLE: dict[State, dict[Event, Step]] = {
    State.IDLE: {
        Heard.BEAT: Step(State.WATCHING, Action.ECHO),
        Heard.GIVES_WAY: Step(State.IDLE, Action.ECHO),
        Heard.REST: Step(State.IDLE, Action.FREE),
        Heard.SILENCE: Step(State.IDLE),
        Heard.CLOSED: _DONE,
    },
    State.WATCHING: {
        Heard.BEAT: Step(State.WATCHING, Action.ECHO),
        Heard.GIVES_WAY: Step(State.IDLE, Action.ECHO),
        Heard.REST: Step(State.IDLE, Action.FREE),
        Heard.SILENCE: Step(State.TAKING_OVER, Action.TAKE),
        Heard.CLOSED: _WAITING,
    },
    State.TAKING_OVER: _WITH_A_SILENT_DRIVER | _ATTEMPTED,
    State.BARRED: _WITH_A_SILENT_DRIVER | {Heard.SILENCE: Step(State.ENDING_DRIVER, Action.END_DRIVER)},
    State.ENDING_DRIVER: dict(_WITH_A_SILENT_DRIVER),
    State.WAITING_FOR_DRIVER: _WITH_A_SILENT_DRIVER
    | _ATTEMPTED
    | _stays(State.WAITING_FOR_DRIVER, Heard.BEAT, Heard.SILENCE),
    State.GIVEN_WAY: _stays(State.GIVEN_WAY, Heard.BEAT, Heard.GIVES_WAY, Heard.SILENCE, *Outcome)
    | {Heard.REST: Step(State.RELEASING), Heard.CLOSED: _WAITING},
    State.RELEASING: _stays(State.RELEASING, Heard.BEAT, Heard.GIVES_WAY, Heard.REST, Heard.SILENCE, *Outcome)
    | {Outcome.CONFIRMED: Step(State.IDLE, Action.FREE), Heard.CLOSED: _WAITING},
    State.WAITING_FOR_DEVICE: _stays(State.WAITING_FOR_DEVICE, *Heard, *Outcome)
    | {Outcome.CONFIRMED: _DONE, Outcome.RELIEVED: _DONE, Outcome.GONE: _DONE},
}
"""By state and event: the next state and the action. The driver's pipe stays closed in WAITING_FOR_DEVICE."""


def run(
    listen: Callable[[float], Heard],
    attempt: Callable[[State], Outcome],
    act: Callable[[Action], None],
    timeout_s: float,
) -> None:
    """Guard until the work is done.

    `listen(within_s)` waits at most so long for the driver; once its pipe is closed it only waits. `attempt(state)`
    tries to switch the heater off, `act` does what the table says. `timeout_s` of silence mean that a driver that heats
    no longer can.
    """
    state = State.IDLE

    def take(event: Event) -> State:
        step = TABLE[state][event]
        if step.action is not None:
            act(step.action)
        return step.state

    while state is not State.DONE:
        if state in ATTEMPTS:
            state = take(attempt(state))
        if state is not State.DONE:
            state = take(listen(timeout_s if state in PATIENT else LOOK_AGAIN_S))
