"""Exchanges with a device on a bus with random faults.

    python tests/benchmarks/fuzz.py [EXCHANGES] [IN PROCESS]

EXCHANGES are made on each kind of endpoint (pty, tcp, rtu+tcp), and IN PROCESS with RTU and with Modbus TCP in virtual
time. Half of them also meet faults that plain Modbus cannot detect: unsolicited frames behind the next request, and
replies that each repeat the previous reply (see docs/simulator.md). With these faults, a wrong value of a plain read is
counted and printed; a proved read, and an exchange with an echoed sequence number, must still be correct.

The oracle: three registers of the device (watchdog, highest temperature, highest current) are written with numbers
derived from a nonce, which is new for every write. So the correct result of a read is the numbers of the last write, or
of a later one with unknown outcome, or the defaults, because the device may restart at any time. Any other value
means that a wrong reply was accepted, most often an old reply.
"""

from __future__ import annotations

import random
import subprocess
import sys
import tempfile
import tomllib
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from firmware_sim.bench import simulated_device
from firmware_sim.config import load_sim
from firmware_sim.fault_script import FaultScript
from smadrive.clock import VirtualClock
from smadrive.errors import SmadriveError, TransportError
from smadrive.modbus import requests
from smadrive.modbus.bus import NEVER_SILENT_S, BusTiming
from smadrive.modbus.client import PROBES, ModbusClient
from smadrive.modbus.transports.connect import open_transport
from smadrive.modbus.transports.in_process import InProcessTransport
from smadrive.modbus.transports.transport import SerialSettings

FIRST = 48
SPANS = (9950, 1600, 9000)
LEAST = (50, 1, 1)
COUNT = len(SPANS)
TIMING = BusTiming(response_timeout_s=0.01, silence=False, read_retries=0)
SCRIPT = "[random]\nshare = 0.25\nslowest_s = 0.05\n"
ENDPOINTS = ("pty", "tcp", "rtu-tcp")
DETECTABLE = {"tcp": "copies = true\n"}
"""Further faults that a client can detect, by endpoint. Replies of Modbus TCP are numbered, which reveals copies."""
BEYOND = "copies = true\nlag = true\n"
VIRTUAL = "[random]\nshare = 0.3\nslowest_s = 0.6\n"
VIRTUAL_TIMING = BusTiming(response_timeout_s=0.1, read_retries=0)


def pattern(nonce):
    """Return the register words of a nonce. No other nonce of a long run has the same words."""
    return tuple(low + nonce * step % span for low, span, step in zip(LEAST, SPANS, (1, 7, 13), strict=True))


def longest_s(timing):
    """Return the longest allowed time of a call. Each probe, and the request, waits for silence, then for the reply."""
    return (PROBES + 1) * (NEVER_SILENT_S + 4 * timing.response_timeout_s)


@dataclass
class Figures:
    """The results of the exchanges.

    `wrong` are wrong values of proved reads, or after a fault that plain Modbus can detect. `indistinguishable` counts
    wrong values of plain reads after a fault that plain Modbus cannot detect.
    """

    right: int = 0
    wrong: list[str] = field(default_factory=list)
    indistinguishable: int = 0
    proved: int = 0
    caught: int = 0  # stale replies that their echo revealed
    errors: Counter = field(default_factory=Counter)
    slowest_s: float = 0.0
    hangs: int = 0

    def __str__(self):
        failed = ", ".join(f"{count} {name}" for name, count in sorted(self.errors.items()))
        return (
            f"{self.right + len(self.wrong) + self.indistinguishable + self.caught + sum(self.errors.values())} "
            f"exchanges: {self.right} right ({self.proved} of them proved), {len(self.wrong)} wrong values, "
            f"{self.indistinguishable} undetectable wrong values of plain reads, {self.caught} stale ones "
            f"revealed by their echo, {self.hangs} hangs, {failed}; slowest {self.slowest_s:.3f} s"
        )


class Fuzzer:
    """Makes random exchanges through `client`, and compares the results with the oracle."""

    def __init__(self, client, seed, timing=TIMING, *, plain_is_sure=True):
        self.figures = Figures()
        self._client = client
        self._timing = timing
        self._plain_is_sure = plain_is_sure
        self._random = random.Random(seed)
        self._nonce = 0
        self._defaults = requests.registers_of(self._until_answered(requests.read_holding(FIRST, COUNT)))
        self._possible = {self._defaults}  # the defaults are always possible too, because a restart brings them back

    def run(self, exchanges):
        """Make `exchanges` exchanges, and return the figures."""
        act = self._read
        for _ in range(exchanges):
            began_s = self._client.clock.now_s()
            if self._random.random() < 0.3:  # otherwise the same request again: a late reply fits to it
                act = self._random.choice((self._read, self._write, self._exchange, self._echo, self._prove))
            try:
                act()
            except SmadriveError as error:
                self.figures.errors[type(error).__name__] += 1
                if type(error) is TransportError:  # the port is gone: wait for it
                    self._client.clock.sleep_until(self._client.clock.now_s() + self._timing.response_timeout_s)
            took_s = self._client.clock.now_s() - began_s
            self.figures.slowest_s = max(self.figures.slowest_s, took_s)
            self.figures.hangs += took_s > longest_s(self._timing)
        return self.figures

    def _read(self):
        first = self._random.randrange(COUNT)
        count = self._random.randint(1, COUNT - first)
        result = self._execute(requests.read_holding(FIRST + first, count))
        self._judge(result, {words[first : first + count] for words in self._possible | {self._defaults}})

    def _prove(self):
        words = self._execute(requests.read_holding(FIRST, COUNT), proved=True)
        self._judge(words, self._possible | {self._defaults}, sure=True)
        if not self._plain_is_sure and words in self._possible:
            self._possible = {words}

    def _write(self):
        words = self._next()
        if self._random.random() < 0.5:
            self._change(requests.write_registers(FIRST, words), {words})
        else:  # one register of the three: the others keep their words
            after = {(words[0], *before[1:]) for before in self._possible | {self._defaults}}
            self._change(requests.write_register(FIRST, words[0]), after)
        self.figures.right += 1

    def _exchange(self):
        words = self._next()
        self._judge(self._change(requests.exchange(FIRST, words, FIRST, COUNT), {words}), {words})

    def _change(self, request, after):
        self._possible |= after
        words = self._execute(request)
        if self._plain_is_sure:
            self._possible = after
        return words

    def _echo(self):
        """Write a sequence number and read it back among the measurements, like every tick of a control loop."""
        self._nonce += 1
        sequence = 0x100 + self._nonce % 0xFF00
        words = self._execute(requests.exchange(32, (sequence, 0, 0), 16, 11))
        if words[0] != sequence:
            self._client.distrust()
            self.figures.caught += 1
            return
        self._judge(words[:1], {(sequence,)}, sure=True)

    def _next(self):
        self._nonce += 1
        return pattern(self._nonce)

    def _execute(self, request, *, proved=False):
        return requests.registers_of(self._client.execute(1, request, self._timing, proved=proved))

    def _judge(self, words, possible, *, sure=False):
        if words in possible:
            self.figures.right += 1
            self.figures.proved += sure
        elif sure or self._plain_is_sure:
            self.figures.wrong.append(f"{words} instead of one of {possible}")
        else:
            self.figures.indistinguishable += 1

    def _until_answered(self, request):
        while True:
            try:
                return self._client.execute(1, request, self._timing)
            except SmadriveError:
                continue


def served(endpoint, exchanges, beyond="", seed=1):
    """Run against the served simulator at this kind of endpoint, and return the figures."""
    with tempfile.TemporaryDirectory() as folder:
        script = Path(folder, "faults.toml")
        script.write_text(SCRIPT + beyond, encoding="utf-8")
        option = ["--pty", str(Path(folder, "port"))] if endpoint == "pty" else [f"--{endpoint}", "0"]
        command = [sys.executable, "-m", "firmware_sim.cli", "flexinol-lt-0.15mm", "--faults", str(script), *option]
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as simulator:
            try:
                with open_transport(simulator.stdout.readline().strip(), SerialSettings()) as transport:
                    return reported(endpoint, beyond, ModbusClient(transport), exchanges, seed, TIMING)
            finally:
                simulator.kill()


def in_process(protocol, exchanges, beyond="", seed=1):
    """Run in virtual time, without a process or a port, and return the figures."""
    device = simulated_device(load_sim("flexinol-lt-0.15mm"), seed)
    device.bench.follow_script(FaultScript.model_validate(tomllib.loads(VIRTUAL + beyond)))
    numbered = protocol == "tcp"
    device.line.port = device.line.new_port(numbered=numbered)
    clock = VirtualClock()
    clock.follow(device.bench.advance_to)
    transport = InProcessTransport(device.line, clock, None if numbered else 115200)
    device.faults.connect(transport, numbered=numbered)
    return reported(f"in process, {protocol}", beyond, ModbusClient(transport), exchanges, seed, VIRTUAL_TIMING)


def reported(name, beyond, client, exchanges, seed, timing):
    """Run, print and return the figures."""
    figures = Fuzzer(client, seed, timing, plain_is_sure=beyond != BEYOND).run(exchanges)
    kind = " ".join(beyond.split()) or "detectable by plain Modbus"
    print(f"{name} ({kind}): {figures}\n    {client.counters}", *figures.wrong[:5], sep="\n    ", flush=True)
    return figures


def main():
    exchanges = int(sys.argv[1]) if len(sys.argv) > 1 else 100_000
    simulated = int(sys.argv[2]) if len(sys.argv) > 2 else 10 * exchanges
    figures = []
    for run, endpoints, number in ((in_process, ("rtu", "tcp"), simulated // 2), (served, ENDPOINTS, exchanges)):
        for endpoint in endpoints:
            figures += [run(endpoint, number // 2, beyond) for beyond in (DETECTABLE.get(endpoint, ""), BEYOND)]
    sys.exit(any(one.wrong or one.hangs for one in figures))


if __name__ == "__main__":
    main()
