"""The states of a guardian as a table. This file knows no processes, ports or clocks.

    IDLE                 the driver lives and nothing heats
    WATCHING             the driver heats; if it is silent for too long, the guardian takes over
    TAKING_OVER          the driver is silent; the heater is not confirmed off
    BARRED               the driver is silent, and the device behind a network does not answer: the driver may hold the
                         only connection that the device accepts
    ENDING_DRIVER        the guardian has killed the driver, to get the connection, and waits for the end of the driver
    WAITING_FOR_DRIVER   the guardian confirms the heater off repeatedly: the driver may wake and send one last command
    GIVEN_WAY            the driver woke and closed its connections, but does not wait for its ports yet
    RELEASING            the driver waits for its ports, and gets them when the heater is confirmed off (after a
                         take-over: confirmed off once more)
    WAITING_FOR_DEVICE   the driver has ended; the heater has not been confirmed off since then
    DONE                 the guardian ends

The guardian can open a serial port while a driver that stands still has it open. A device or gateway behind a socket
may accept only one client, which is the driver as long as it lives. The guardian cannot distinguish this from an
unplugged device, so it kills the driver in both cases: a living driver could take the connection when the device is
plugged in again. If both processes stood still, the wait in BARRED continues after the guardian wakes, so the driver
has time to give way.

A driver that lives but cannot reach its device hands over: its heartbeats would keep the guardian from a device that
the guardian may find at another port. HAND_OVER leads to RELEASING from every state in which the driver lives, also
from IDLE: the guardian may have missed the signals before it.

In the states of `ATTEMPTS` the guardian tries to switch the heater off, then listens to the driver; in the other
states it only listens. The table has an entry for every event that can occur in a state.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from enum import Enum, auto
from typing import NamedTuple

LOOK_AGAIN_S = 0.5
"""Pause between two attempts, in seconds."""


class GuardianState(Enum):
    """A state of the guardian; see the head of this file."""

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


class WatchState(Enum):
    """The state of the guardian as far as the driver knows it.

    STANDING_BY    the guardian does not watch: nothing heats, or the source is confirmed off
    WATCHED        the guardian watches: the driver heats and sends heartbeats
    TAKEN_OVER     the driver was silent for too long, so the guardian uses the ports
    HANDED_OVER    the driver could not switch the source off, so the guardian uses the ports
    """

    STANDING_BY = auto()
    WATCHED = auto()
    TAKEN_OVER = auto()
    HANDED_OVER = auto()


REASONS = {
    WatchState.TAKEN_OVER: "the driver stood still",
    WatchState.HANDED_OVER: "the driver could not switch the heater off",
}
"""The states in which the guardian uses the ports, and the reason of each."""


class DriverSignal(Enum):
    """A signal of the driver through the pipe, the driver's silence, or the end of the pipe."""

    HEARTBEAT = auto()
    GIVES_WAY = auto()
    STAND_DOWN = auto()
    HAND_OVER = auto()
    """The driver lives but could not switch off. It has closed its connections, and waits for its ports."""
    SILENCE = auto()
    CLOSED = auto()


class AttemptOutcome(Enum):
    """The outcome of an attempt to switch the heater off."""

    CONFIRMED = auto()
    UNREACHABLE = auto()
    UNREACHABLE_REMOTE = auto()
    """The device does not answer, and it is behind a network."""
    ANOTHER_DEVICE = auto()
    CURRENT_FLOWS = auto()
    """The device is in its safe state, but a current still flows, or is not known to be zero."""
    BUSY = auto()
    """Another program uses the line."""
    RELIEVED = auto()
    """A new driver or `smadrive off` has confirmed the device off."""
    GONE = auto()
    """The port was a pseudo-terminal that has ended, so it never comes back."""


Event = DriverSignal | AttemptOutcome


class Action(Enum):
    """An action of the guardian between two states."""

    ECHO = auto()
    FREE = auto()
    """Tell the driver that the ports are free."""
    TAKE = auto()
    """Tell the driver that its ports are taken."""
    END_DRIVER = auto()


class Transition(NamedTuple):
    """The next state, and the action that the guardian carries out before it."""

    state: GuardianState
    action: Action | None = None


ATTEMPTS = frozenset(
    {
        GuardianState.TAKING_OVER,
        GuardianState.WAITING_FOR_DRIVER,
        GuardianState.GIVEN_WAY,
        GuardianState.RELEASING,
        GuardianState.WAITING_FOR_DEVICE,
    }
)
PATIENT = frozenset({GuardianState.IDLE, GuardianState.WATCHING, GuardianState.BARRED})
"""States in which the driver may be silent for `timeout_s`. In other states the guardian listens for `LOOK_AGAIN_S`."""

_HANDED_OVER = Transition(GuardianState.RELEASING, Action.TAKE)
_TAKING_OVER, _WAITING = Transition(GuardianState.TAKING_OVER), Transition(GuardianState.WAITING_FOR_DEVICE)
_DONE, _BARRED = Transition(GuardianState.DONE), Transition(GuardianState.BARRED)

_WITH_A_SILENT_DRIVER: dict[Event, Transition] = {
    DriverSignal.HEARTBEAT: _TAKING_OVER,
    DriverSignal.GIVES_WAY: Transition(GuardianState.GIVEN_WAY),
    DriverSignal.STAND_DOWN: Transition(GuardianState.RELEASING),
    DriverSignal.HAND_OVER: _HANDED_OVER,
    DriverSignal.SILENCE: _TAKING_OVER,
    DriverSignal.CLOSED: _WAITING,
}
_ATTEMPTED: dict[Event, Transition] = {
    **dict.fromkeys(AttemptOutcome, _TAKING_OVER),
    AttemptOutcome.CONFIRMED: Transition(GuardianState.WAITING_FOR_DRIVER),
    AttemptOutcome.UNREACHABLE_REMOTE: _BARRED,
}


def _stays(state: GuardianState, *events: Event) -> dict[Event, Transition]:
    return {event: Transition(state) for event in events}


TABLE: dict[GuardianState, dict[Event, Transition]] = {
    GuardianState.IDLE: {
        DriverSignal.HEARTBEAT: Transition(GuardianState.WATCHING, Action.ECHO),
        DriverSignal.GIVES_WAY: Transition(GuardianState.IDLE, Action.ECHO),
        DriverSignal.STAND_DOWN: Transition(GuardianState.IDLE, Action.FREE),
        DriverSignal.HAND_OVER: _HANDED_OVER,
        DriverSignal.SILENCE: Transition(GuardianState.IDLE),
        DriverSignal.CLOSED: _DONE,
    },
    GuardianState.WATCHING: {
        DriverSignal.HEARTBEAT: Transition(GuardianState.WATCHING, Action.ECHO),
        DriverSignal.GIVES_WAY: Transition(GuardianState.IDLE, Action.ECHO),
        DriverSignal.STAND_DOWN: Transition(GuardianState.IDLE, Action.FREE),
        DriverSignal.HAND_OVER: _HANDED_OVER,
        DriverSignal.SILENCE: Transition(GuardianState.TAKING_OVER, Action.TAKE),
        DriverSignal.CLOSED: _WAITING,
    },
    GuardianState.TAKING_OVER: _WITH_A_SILENT_DRIVER | _ATTEMPTED,
    GuardianState.BARRED: _WITH_A_SILENT_DRIVER
    | {DriverSignal.SILENCE: Transition(GuardianState.ENDING_DRIVER, Action.END_DRIVER)},
    GuardianState.ENDING_DRIVER: dict(_WITH_A_SILENT_DRIVER),
    GuardianState.WAITING_FOR_DRIVER: _WITH_A_SILENT_DRIVER
    | _ATTEMPTED
    | _stays(GuardianState.WAITING_FOR_DRIVER, DriverSignal.HEARTBEAT, DriverSignal.SILENCE),
    GuardianState.GIVEN_WAY: _stays(
        GuardianState.GIVEN_WAY, DriverSignal.HEARTBEAT, DriverSignal.GIVES_WAY, DriverSignal.SILENCE, *AttemptOutcome
    )
    | {
        DriverSignal.STAND_DOWN: Transition(GuardianState.RELEASING),
        DriverSignal.HAND_OVER: _HANDED_OVER,
        DriverSignal.CLOSED: _WAITING,
    },
    GuardianState.RELEASING: _stays(
        GuardianState.RELEASING,
        DriverSignal.HEARTBEAT,
        DriverSignal.GIVES_WAY,
        DriverSignal.STAND_DOWN,
        DriverSignal.SILENCE,
        *AttemptOutcome,
    )
    | {
        AttemptOutcome.CONFIRMED: Transition(GuardianState.IDLE, Action.FREE),
        DriverSignal.HAND_OVER: _HANDED_OVER,
        DriverSignal.CLOSED: _WAITING,
    },
    GuardianState.WAITING_FOR_DEVICE: _stays(GuardianState.WAITING_FOR_DEVICE, *DriverSignal, *AttemptOutcome)
    | {AttemptOutcome.CONFIRMED: _DONE, AttemptOutcome.RELIEVED: _DONE, AttemptOutcome.GONE: _DONE},
}
"""The next state and the action, by state and event. In WAITING_FOR_DEVICE the driver has closed the pipe."""


def run(
    listen: Callable[[float], DriverSignal],
    attempt: Callable[[GuardianState], AttemptOutcome],
    act: Callable[[Action], None],
    timeout_s: float,
) -> None:
    """Run the table of states until DONE.

    `listen(within_s)` waits at most `within_s` for a signal of the driver. After the driver has closed the pipe,
    `listen` waits the whole time. `attempt(state)` tries to switch the heater off. `act` carries out an action. A
    driver that heats counts as dead after a silence of `timeout_s`. An error of `attempt` counts as UNREACHABLE, and an
    error of `act` changes nothing, because no error may end the guardian.
    """
    state = GuardianState.IDLE

    def take(event: Event) -> GuardianState:
        step = TABLE[state][event]
        if step.action is not None:
            with suppress(Exception):
                act(step.action)
        return step.state

    def outcome() -> AttemptOutcome:
        try:
            return attempt(state)
        except Exception:  # noqa: BLE001
            return AttemptOutcome.UNREACHABLE

    while state is not GuardianState.DONE:
        if state in ATTEMPTS:
            state = take(outcome())
        if state is not GuardianState.DONE:
            state = take(listen(timeout_s if state in PATIENT else LOOK_AGAIN_S))
