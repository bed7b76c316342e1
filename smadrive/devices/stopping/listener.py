"""The driver's end of the emergency stop: it listens for requests, and ends the driver's use of the heater.

A request interrupts the main thread of the driver like Ctrl-C (SIGINT). After Ctrl-C every driver ends at zero current,
also while it waits for a reply or a deadline. A driver may ignore the interruption, or use its rig in another
thread. `check` ends such a driver with StoppedError: `Heater` calls it before every exchange.

Only the first request interrupts, so later requests cannot disturb the switching off.
"""

from __future__ import annotations

import selectors
import signal
import socket
import threading
from collections.abc import Iterable
from contextlib import suppress
from types import TracebackType
from typing import Self
from weakref import WeakSet

from smadrive.devices.stopping.endpoint import IS_POSSIBLE, REFUSED, address_of, alternative_names, peer_of
from smadrive.errors import STOPPED, BusyError, StoppedError, free_the_line
from smadrive.posix import released_in_children

BACKLOG = 16
MOST_ASKERS = 64
"""Number of requests that a driver accepts. Further requests wait in the backlog until the driver has ended."""


class StopListener:
    """Listens for requests to stop this driver. `where` is its name in messages. A context manager.

    Enter the context before the ports are opened, and leave it after they are closed: at its end, every program that
    sent a request learns that the line is free. After a request, the `with` block always ends with StoppedError. An
    error of the block becomes the cause of StoppedError, so that no program handles this error by heating again.
    """

    def __init__(self, where: str) -> None:
        self._where = where
        self._requester = "`smadrive off`"
        self._requested = self._is_closing = False
        self._mutex = threading.Lock()
        self._selector = selectors.DefaultSelector()
        self._listening: dict[socket.socket, str] = {}
        self._askers: list[socket.socket] = []
        self._wakers: tuple[socket.socket, ...] = ()
        self._thread: threading.Thread | None = None
        self._is_main = threading.current_thread() is threading.main_thread()
        _listeners.add(self)

    @property
    def requested(self) -> bool:
        """True if a process has asked this driver to stop."""
        return self._requested

    @property
    def requested_by(self) -> str:
        """The program that has asked this driver to stop, as text; empty without a request."""
        return self._requester if self._requested else ""

    def listen(self, line: str, names: Iterable[str]) -> None:
        """Listen at the address of each name of `line`. BusyError when another driver listens there."""
        if not IS_POSSIBLE:
            return
        for name in names:
            listening = _listening(name)
            self._listening[listening] = line
            self._selector.register(listening, selectors.EVENT_READ)
        if self._listening and self._thread is None:
            self._wakers = socket.socketpair()
            self._selector.register(self._wakers[1], selectors.EVENT_READ)
            self._thread = threading.Thread(target=self._serve, name="emergency stop", daemon=True)
            self._thread.start()

    def request(self, by: str) -> None:
        """Stop this driver, as a request of another process does. The message of StoppedError names `by`.

        Any thread may call this method.
        """
        self._requester = by
        self._interrupt()

    def check(self) -> None:
        """Raise StoppedError if a process has asked this driver to stop."""
        if self._requested:
            raise self._stopped()

    def __enter__(self) -> Self:
        """Do nothing: `listen` begins to listen."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop listening, and close all connections. StoppedError if a process has asked to stop."""
        late: BaseException | None = None
        try:
            self._close()
        except (KeyboardInterrupt, SystemExit) as interruption:  # a request arrived after the end of the block
            late = interruption
            self._close()
        if self._requested and not isinstance(error, StoppedError):
            stopped = self._stopped()
            for note in getattr(error, "__notes__", ()):
                stopped.add_note(note)
            raise stopped from error or late
        if late is not None and not self._requested:
            raise late

    def close_inherited(self) -> None:
        """Close the sockets in a forked child, because only its parent is the driver."""
        for one in (*self._listening, *self._askers, *self._wakers):
            one.close()

    def _stopped(self) -> StoppedError:
        return StoppedError(f"{self._where}: {STOPPED} {self._requester}")

    def _close(self) -> None:
        with self._mutex:
            self._is_closing = True
        if self._thread is not None:
            _shut(self._wakers[0])
            self._thread.join()
        for listening, line in self._listening.items():
            _shut(listening)
            while self._accept(listening, line):  # a request that the thread has not accepted
                pass
        for one in (*self._askers, *self._listening, *self._wakers):
            _shut(one)
            one.close()
        self._selector.close()

    def _serve(self) -> None:
        while True:
            for key, _ in self._selector.select():
                assert isinstance(key.fileobj, socket.socket)
                if key.fileobj not in self._listening:
                    return
                self._accept(key.fileobj, self._listening[key.fileobj])
                if len(self._askers) >= MOST_ASKERS:  # otherwise the process could run out of descriptors
                    self._selector.unregister(key.fileobj)

    def _accept(self, listening: socket.socket, line: str) -> bool:
        """Accept or refuse the next request; return False if no request waits."""
        try:
            asker, _ = listening.accept()
        except OSError:
            return False
        with suppress(OSError):
            if peer_of(asker).may_stop(line):
                self._askers.append(asker)
                self._interrupt()
            else:
                with asker:
                    asker.sendall(REFUSED)
        return True

    def _interrupt(self) -> None:
        """Interrupt the driver, unless it is already interrupted or ending."""
        with self._mutex:
            interrupts = self._is_main and not (self._requested or self._is_closing)
            self._requested = True
            if interrupts:
                signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)


_listeners: WeakSet[StopListener] = released_in_children(lambda one: one.close_inherited())


def _shut(one: socket.socket) -> None:
    """End the connections of a socket, even if a forked child has a copy of the socket."""
    with suppress(OSError):
        one.shutdown(socket.SHUT_RDWR)


def _listening(name: str) -> socket.socket:
    """Return a socket that listens at the first free name of `alternative_names(name)`; BusyError if none is free."""
    for free_name in alternative_names(name):
        listening = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            listening.bind(address_of(free_name))
        except OSError:
            listening.close()
            continue
        listening.listen(BACKLOG)
        listening.setblocking(False)
        return listening
    raise _busy(name)


def _busy(name: str) -> BusyError:
    """Return the BusyError for a line that another driver uses, perhaps a driver of another user."""
    return BusyError("busy, another driver uses the line", where=name, cure=free_the_line(None))
