"""The loop of the simulator process: it moves bytes between endpoints and a simulation, and advances the time.

In real time the simulation follows the machine's monotonic clock. In lockstep time a parent process writes times to the
standard input of the server, in seconds, one number per line. The server repeats the line on standard output when the
simulation has reached this time. So a test or a demo with the real protocol on a real port is repeatable, and runs as
fast as the machine can compute.
"""

from __future__ import annotations

import contextlib
import heapq
import math
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Protocol

from firmware_sim.bus.faults import FaultyConnection
from firmware_sim.server.endpoint import Endpoint
from firmware_sim.server.readiness import readable
from smadrive.errors import ConfigError
from smadrive.files.number_text import parse_number, shortened

STEP_S = 0.01
_CHUNK = 512
_HANDLES_SIGNALS_EVERY_S = 0.2
"""The longest wait in s in lockstep time: a signal that arrives just before a wait is handled after it."""


class Simulation(Protocol):
    """The simulation that is served: a bench, or a replayed recording."""

    @property
    def time_s(self) -> float:
        """The time of the simulation."""
        ...

    def advance_to(self, time_s: float) -> None:
        """Run the simulation until `time_s`. Do nothing for a time in the past."""
        ...


class _LineBuffer:
    """Cuts the bytes from a descriptor into complete lines."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> list[str]:
        *lines, self._rest = (self._rest + data).split(b"\n")
        return [line.decode("ascii", "replace").strip() for line in lines]


class Server:
    """Moves bytes between endpoints and a simulation until it is stopped."""

    def __init__(self, simulation: Simulation, endpoints: Sequence[Endpoint]) -> None:
        self._simulation = simulation
        self._endpoints = endpoints
        self._agenda: list[tuple[float, int, Callable[[], None]]] = []
        self._order = 0
        self._returns_s: dict[Endpoint, float] = {}

    def faulty_connection(self, endpoint: Endpoint) -> FaultyConnection:
        """Return all clients of `endpoint` as one connection, on which the faults of the line act."""
        return _EndpointClients(endpoint, self._do_at, self._close_until)

    def run_real(self) -> None:
        """Follow the monotonic clock, in steps of 10 ms at most, until KeyboardInterrupt."""
        start_s = time.monotonic() - self._simulation.time_s
        while True:
            next_s = min(self._simulation.time_s + STEP_S, self._agenda[0][0] if self._agenda else math.inf)
            endpoints = self._by_descriptor()
            ready = readable(endpoints, max(start_s + next_s - time.monotonic(), 0.0))
            self._pass_time(time.monotonic() - start_s)
            for descriptor in ready:
                self._take_request(endpoints[descriptor], descriptor)

    def run_lockstep(self) -> None:
        """Run the simulation to each time that arrives on standard input. Return when standard input ends.

        ConfigError for a line that is not a time.
        """
        buffer = _LineBuffer()
        stdin = sys.stdin.fileno()
        while True:
            endpoints = self._by_descriptor()
            ready = readable((*endpoints, stdin), _HANDLES_SIGNALS_EVERY_S)
            for descriptor in ready:
                if descriptor != stdin:
                    self._take_request(endpoints[descriptor], descriptor)
            if stdin in ready:
                data = os.read(stdin, _CHUNK)
                if not data:
                    return
                for line in buffer.feed(data):
                    self._pass_time(_time_of(line))
                    sys.stdout.write(line + "\n")
                    sys.stdout.flush()

    def _by_descriptor(self) -> dict[int, Endpoint]:
        return {descriptor: endpoint for endpoint in self._endpoints for descriptor in endpoint.descriptors()}

    def _pass_time(self, time_s: float) -> None:
        self._simulation.advance_to(time_s)
        while self._agenda and self._agenda[0][0] <= self._simulation.time_s:
            heapq.heappop(self._agenda)[2]()

    def _take_request(self, endpoint: Endpoint, descriptor: int) -> None:
        received = endpoint.receive(descriptor)
        if received is None:
            return
        connection, data = received
        for due_s, reply in connection.port.receive(data, self._simulation.time_s):
            self._do_at(due_s, partial(connection.send, reply))

    def _do_at(self, due_s: float, action: Callable[[], None]) -> None:
        if due_s <= self._simulation.time_s:
            action()
        else:
            self._order += 1
            heapq.heappush(self._agenda, (due_s, self._order, action))

    def _close_until(self, endpoint: Endpoint, return_s: float) -> None:
        """Close `endpoint` until `return_s`; until the later time if it is closed already until another time."""
        endpoint.close()
        self._returns_s[endpoint] = max(return_s, self._returns_s.get(endpoint, return_s))
        self._do_at(return_s, partial(self._reopen, endpoint))

    def _reopen(self, endpoint: Endpoint) -> None:
        """Open `endpoint`, if it is closed and the time of its return has come."""
        if self._returns_s.get(endpoint, math.inf) <= self._simulation.time_s:
            del self._returns_s[endpoint]
            endpoint.open()


class _EndpointClients:
    """All clients of one endpoint, as one connection on which the faults of the line act."""

    def __init__(
        self,
        endpoint: Endpoint,
        do_at: Callable[[float, Callable[[], None]], None],
        close_until: Callable[[Endpoint, float], None],
    ) -> None:
        self._endpoint = endpoint
        self._do_at = do_at
        self._close_until = close_until

    def deliver(self, due_s: float, data: bytes) -> None:
        """Let `data` arrive at `due_s` at every client that is connected now."""
        for connection in self._endpoint.connections():
            self._do_at(due_s, partial(connection.send, data))

    def disconnect(self, return_s: float) -> None:
        """Close the endpoint, with all connections; open it again at `return_s`."""
        self._close_until(self._endpoint, return_s)


def _time_of(line: str) -> float:
    try:
        time_s = parse_number(line)
    except ValueError:
        time_s = math.nan
    if not math.isfinite(time_s):
        raise ConfigError(
            "a line of standard input is not a time",
            where="--time lockstep",
            value=shortened(line),
            cure="write the time in seconds, one number per line",
        )
    return time_s


@contextlib.contextmanager
def stop_on_signal() -> Iterator[None]:
    """In the `with` block, SIGTERM raises KeyboardInterrupt, like Ctrl-C."""
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
