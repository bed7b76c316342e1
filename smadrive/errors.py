"""The errors of smadrive.

The class says in which part the cause lies: files, connection, device, safety or data. The message names what is wrong,
where, the value, the limit and the cure.

    SmadriveError
    ├── ConfigError             the user's files and options                    exit code 2
    │   ├── DataError           data, or a file or folder for data, cannot be used
    │   └── ModelError          a hysteresis model that is not valid
    │       └── CertificateError    a model without the certificates that its use needs
    ├── TransportError          the connection failed: no port, port lost       exit code 3
    │   ├── BusyError           another process has locked the port
    │   └── DeadlineError       no complete reply before the deadline
    ├── ProtocolError           a reply that is not the answer to the request   exit code 3
    ├── DeviceError             the device rejects a request                    exit code 3
    │   ├── ExceptionReply      a Modbus exception code
    │   ├── IdentityError       another device than the profile describes
    │   └── ReadBackError       a written value that did not arrive
    ├── SafetyError             heating refused, or stopped by the supervisor   exit code 4
    │   ├── TripError           a latched trip
    │   ├── TakenOverError      the guardian has taken over the heater
    │   ├── UnknownCurrentError switched off, but no current is measured
    │   ├── FrontSilentError    no process answers OFF of the tuning page
    │   └── LoopProcessError    the loop process of a script has ended
    ├── ControllerError         a controller of the user fails                  exit code 2
    ├── MotionError             a motion of a servo has not reached its end     exit code 4
    └── IdentificationError     the data do not determine the model             exit code 5

    BaseException
    └── StoppedError            `smadrive off` has stopped the driver           exit code 4
"""

from __future__ import annotations

from typing import Any

STOPPED = "stopped by"
"""In errors and in the state of a rig, the name of the program that made an emergency stop follows these words."""


def free_the_line(pid: int | None) -> str:
    """Return the cure for a line that another program uses; `pid` is None if its process is unknown."""
    kill = "`kill PID`" if pid is None else f"`kill {pid}`"
    return (
        f"wait until that program has ended, or end it: run `smadrive off RIG`, press Ctrl-C in its terminal, or run "
        f"{kill}. A program of smadrive switches its heater off before it ends"
    )


class SmadriveError(Exception):
    """Base class of all errors of smadrive. The message: `<where>: <what> (<value>, limit <limit>). <Cure>.`

    what     the problem
    where    the file, register, device or option with the problem
    value    the value that was found, with its unit
    limit    the limit that the value violates
    cure     what the user can do, as an imperative or a question; a cure of several sentences keeps its punctuation

    All parts but `what` may be left out.
    `exit_code` is the exit code of the command line for this error.
    """

    exit_code = 1

    def __init__(
        self, what: str, *, where: object = "", value: object = None, limit: object = None, cure: str = ""
    ) -> None:
        super().__init__(what)
        self.what = what
        self.where = str(where)
        self.value = value
        self.limit = limit
        self.cure = cure

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle with every attribute and note, so that an error passes between processes unchanged."""
        return _restored, (type(self), self.args), self.__dict__

    def __str__(self) -> str:
        facts = [] if self.value is None else [_text(self.value)]
        facts += [] if self.limit is None else [f"limit {_text(self.limit)}"]
        text = f"{self.where}: {self.what}" if self.where else self.what
        text += f" ({', '.join(facts)})" if facts else ""
        return f"{_sentence(text)} {_sentence(self.cure[0].upper() + self.cure[1:])}" if self.cure else text


def _restored(kind: type[SmadriveError], arguments: tuple[object, ...]) -> SmadriveError:
    """Return an error without its attributes, which the unpickler sets."""
    return kind.__new__(kind, *arguments)


def _text(value: object) -> str:
    """Return the value as text; a float is rounded to six digits."""
    return f"{value:g}" if isinstance(value, float) else str(value)


def _sentence(text: str) -> str:
    """Return the text with a full stop, unless it already ends with a punctuation mark."""
    return text if text.endswith((".", "?", "!")) else f"{text}."


class ConfigError(SmadriveError):
    """A file or an option of the user cannot be used as it stands."""

    exit_code = 2


class DataError(ConfigError):
    """Data, or a file or folder for data, cannot be used: for example, a column is missing, or a log is damaged."""


class ModelError(ConfigError):
    """A hysteresis model with invalid parameters (crossing branches, σ ≤ 0, fuzzy sets outside the range)."""


class CertificateError(ModelError):
    """A model without the certificates that its use requires."""


class TransportError(SmadriveError):
    """The connection failed: the port is missing, busy, forbidden or gone."""

    exit_code = 3


class BusyError(TransportError):
    """Another process has locked the serial port, the line behind a socket, or the unit of a gateway.

    This is usually a driver, a guardian, or `smadrive off`. `holder_pid` is the id of the process; None if unknown.
    """

    holder_pid: int | None = None


class DeadlineError(TransportError):
    """No complete reply arrived before the absolute deadline."""


class ProtocolError(SmadriveError):
    """A reply is not the answer to the request: its CRC, unit, function, byte count or sequence number is wrong."""

    exit_code = 3


class MotionError(SmadriveError):
    """A motion of a servo has not reached its end: it took too long, another motion replaced it, or the run ended."""

    exit_code = 4


class DeviceError(SmadriveError):
    """The device rejects a request, or its answer is not the expected one."""

    exit_code = 3


class ExceptionReply(DeviceError):
    """A Modbus exception reply. `code` is the exception code: 1 illegal function, 2 illegal data address, ...

    With `is_transient`, a busy device or gateway has sent it, which may carry out the next request.
    """

    def __init__(
        self,
        what: str,
        code: int,
        is_transient: bool = False,
        *,
        where: object = "",
        value: object = None,
    ) -> None:
        super().__init__(what, where=where, value=value)
        self.code, self.is_transient = code, is_transient


class IdentityError(DeviceError):
    """The device on the bus is not the device that the profile describes."""


class ReadBackError(DeviceError):
    """The value that was read back from a register differs from the written value."""


class SafetyError(SmadriveError):
    """Heating is refused, or was stopped."""

    exit_code = 4


class UnknownCurrentError(SafetyError):
    """The heater was switched off, but its current is unknown, so nothing confirms that."""


class TripError(SafetyError):
    """The supervisor or the device tripped.

    `number` is the number of the fault. `what` is the whole sentence of the trip: number, cause, value, limit, remedy.
    `cure` says how to clear the latched fault.
    """

    def __init__(self, what: str, number: int, *, value: object = None, limit: object = None, cure: str = "") -> None:
        super().__init__(what, value=value, limit=limit, cure=cure)
        self.number = number

    def __str__(self) -> str:
        return f"{_sentence(self.what)} {_sentence(self.cure)}" if self.cure else self.what


class TakenOverError(SafetyError):
    """The guardian has taken over the heater; the heater may not be off yet.

    The driver stood still, or could not switch the heater off.
    """


class FrontSilentError(SafetyError):
    """The front process of the tuning page does not answer, so OFF on the page has no effect."""


class LoopProcessError(SafetyError):
    """The loop process of a script has ended. If it died, the watchdog or the guardian switches the heater off."""


class ControllerError(SmadriveError):
    """A controller of the user failed.

    It cannot be pickled, returned no valid command, took too long, or raised an error that cannot be pickled.
    """

    exit_code = 2


class IdentificationError(SmadriveError):
    """The data do not determine the requested model."""

    exit_code = 5


class StoppedError(BaseException):
    """`smadrive off` has stopped the driver. No trip is latched.

    Like KeyboardInterrupt, it is not an Exception: a program that tries again after every error must not heat again
    after an emergency stop.
    """

    exit_code = 4
