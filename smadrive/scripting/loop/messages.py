"""The messages between a script and the process of its loop.

The script sends requests; each gets one reply, a result or a failure. During a run the process also sends its progress.
The messages are pickled: both ends belong to one user and share a pair of sockets that no other process can reach.
"""

from __future__ import annotations

import os
import signal
import socket
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, NamedTuple

from smadrive.control.controllers.step import ManualStep
from smadrive.control.loop import Tick
from smadrive.control.references.reference import Reference
from smadrive.interrupts import HeldSignals
from smadrive.measurement import DisplacementFrom
from smadrive.rig.config import RigConfig
from smadrive.runs.cycling.cycles import Cycling
from smadrive.wire.identified_wire import IdentifiedWire

REQUEST, INTERRUPT, END, COMMAND = b"R", b"I", b"E", b"C"
"""The first byte of a message to the loop process.

REQUEST     carry out a request
INTERRUPT   interrupt the request that is being carried out
END         end the process
COMMAND     a command for the servo whose request is being carried out
"""

NUMBER_BYTES = 8
"""In a REQUEST and in an INTERRUPT, the number of the request follows the first byte, in this number of bytes."""


@dataclass(frozen=True)
class OpenRequest:
    """Open the rig. Modules are imported from `module_path`, the `sys.path` of the script."""

    config: RigConfig
    module_path: tuple[str, ...]


@dataclass(frozen=True)
class MeasureRequest:
    """Measure once, at zero current."""


@dataclass(frozen=True)
class ExciteRequest:
    """Run the identification experiment."""

    log_file: Path


@dataclass(frozen=True)
class HeatRequest:
    """Hold a current or a temperature."""

    log_file: Path
    step: ManualStep


@dataclass(frozen=True)
class TrackRequest:
    """Track a reference on an identified wire."""

    log_file: Path
    reference: Reference
    wire: IdentifiedWire
    smooth: bool
    cycling: Cycling | None = None
    displacement_from: DisplacementFrom | None = None


@dataclass(frozen=True)
class DriveRequest:
    """Run the user's controller on a wire for `duration_s`. If this is None, the controller gives the duration."""

    log_file: Path
    controller: Any
    duration_s: float | None
    wire: IdentifiedWire


@dataclass(frozen=True)
class ServoRequest:
    """Hold the wire, and carry out the commands for the servo `servo_id`, until a StopCommand."""

    servo_id: str
    log_file: Path
    wire: IdentifiedWire


@dataclass(frozen=True)
class CoolDownRequest:
    """Let the wire cool with the heater off."""

    duration_s: float


@dataclass(frozen=True)
class SwitchOffRequest:
    """Switch the heater off, and confirm it by read-back."""


@dataclass(frozen=True)
class LatchRequest:
    """Read the trip latch."""


@dataclass(frozen=True)
class ClearFaultsRequest:
    """Clear the latched faults of the devices and the trip latch."""


@dataclass(frozen=True)
class CloseRequest:
    """Switch the heater off, confirm it by read-back, close the ports and end the process."""


LongRequest = ExciteRequest | HeatRequest | TrackRequest | DriveRequest | ServoRequest | CoolDownRequest
"""The requests that may take long. Another thread that switches off ends them."""

AnyScriptRequest = LongRequest | MeasureRequest | SwitchOffRequest | LatchRequest | ClearFaultsRequest
"""The requests to an open rig."""


class OpenedRig(NamedTuple):
    """The result of an OpenRequest: identities of the devices by name, kind of time, and measured quantities."""

    identities: dict[str, str]
    is_virtual: bool
    quantities: tuple[str, ...]


class DrivenRun(NamedTuple):
    """The result of a run: its missed deadlines, the user's controller after the run, and caveats about it.

    `controller` is None if the run had no such controller, or if it cannot be transferred.
    """

    missed_deadlines: int
    controller: Any = None
    caveats: tuple[str, ...] = ()


class RunProgress(NamedTuple):
    """The progress of a run of `duration_s`: its latest tick."""

    tick: Tick
    duration_s: float


class ScriptEndedError(SystemExit):
    """The script has ended, or has asked the loop process to end."""


class Result(NamedTuple):
    """The reply to a request that was carried out."""

    value: Any


class Failure(NamedTuple):
    """The reply to a request that failed; `traceback` is empty if the message of the error is enough."""

    error: BaseException
    traceback: str


class RemoteTracebackError(Exception):
    """The traceback of an error in the loop process. Python shows it as the cause of the error in the script."""

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self._text = text

    def __str__(self) -> str:
        return f"\n{self._text}"


def send_whole(connection: Connection[Any, Any], message: bytes, lock: AbstractContextManager[Any]) -> None:
    """Send a message to the loop process under `lock`. Signals are held back meanwhile, and obeyed after the release.

    After a part of a message, the loop process takes every later message, even the request to stop, for the rest of
    this one. So an error that cuts the message all the same, such as the `ABORTS_AT`-th signal, also closes the link
    for sending. The loop process then ends its run and itself; its replies still arrive. If the process has ended
    already, nothing is raised.
    """
    with HeldSignals() as held, lock:
        try:
            connection.send_bytes(message)
        except BaseException as error:
            with suppress(OSError), socket.socket(fileno=os.dup(connection.fileno())) as link:
                link.shutdown(socket.SHUT_WR)
            if not isinstance(error, OSError):
                raise
    for number in held.received:
        signal.raise_signal(number)
