"""A simulated device in a process of its own, on a virtual serial port or TCP, for the demo and the tests.

In virtual time the device follows the driver's clock in lockstep: at every jump the clock writes the new time to the
simulator's standard input and waits for the simulator's answer. In real time the device follows the machine's clock.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from types import TracebackType
from typing import Self

from smadrive.clock import Clock, MonotonicClock, VirtualClock
from smadrive.errors import TransportError

ENDS_WITHIN_S = 10.0
"""The simulator is killed if it has not ended at this time in s after the signal to end."""

LOCKSTEP_LATENCY = "?latency_ms=5000"
"""Query of the URL in lockstep time: the driver waits 5 s longer for each reply.

In lockstep time nothing else happens while the driver waits, so a busy machine changes no result.
"""


class ServedSimulator:
    """The child process `firmware-sim SIM`, as a context manager.

    Inside the context, `url` is the address of the simulated device, and `clock` is the clock for the driver. With
    `tcp`, the device serves Modbus TCP instead of a virtual serial port. `log` is the file of the device's messages.
    """

    def __init__(
        self, sim: str, *, real_time: bool = False, tcp: bool = False, seed: int = 0, log: Path | None = None
    ) -> None:
        self._arguments = [
            "-m",
            "firmware_sim.cli",
            sim,
            "--seed",
            str(seed),
            "--time",
            "real" if real_time else "lockstep",
        ]
        if tcp:
            self._arguments += ["--tcp", "0"]
        if log is not None:
            self._arguments += ["--log", str(log)]
        self._virtual = None if real_time else VirtualClock()
        self.clock: Clock = self._virtual or MonotonicClock()
        self.url = ""

    def __enter__(self) -> Self:
        """Start the process and wait for its address. TransportError when the process ends before that."""
        self._process = subprocess.Popen(
            [sys.executable, *self._arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            bufsize=1,
            start_new_session=True,  # Ctrl-C reaches only the driver, which switches off and ends the simulator
        )
        self.url = self._answer() + (LOCKSTEP_LATENCY if self._virtual is not None else "")
        if self._virtual is not None:
            self._virtual.follow(self._advance_to)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the process."""
        self._process.terminate()
        try:
            self._process.communicate(timeout=ENDS_WITHIN_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.communicate()

    def _advance_to(self, time_s: float) -> None:
        if self._process.stdin is None:
            raise TransportError("the simulated device has no standard input")
        try:
            self._process.stdin.write(f"{time_s!r}\n")
        except BrokenPipeError:
            raise TransportError("the simulated device has ended", cure="read the reason in its log file") from None
        self._answer()

    def _answer(self) -> str:
        line = self._process.stdout.readline() if self._process.stdout else ""
        if not line:
            message = self._process.stderr.read().strip() if self._process.stderr else ""
            raise TransportError("the simulated device did not answer", value=message or "no message")
        return line.strip()
