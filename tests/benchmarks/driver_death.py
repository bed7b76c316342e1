"""The time to zero current after the driver dies while heating, in real time, on a board and on a supply.

    python tests/benchmarks/driver_death.py [--trials 200] [--rig board|emulated|supply|gateway] [--fate off]

Every trial starts a bench and a driver as processes of their own. The driver heats, and fails at a random moment in one
of several ways ("fate"). The time ends when the bench logs that the output is off. The table has, for each fate, the
median and worst time, and the number of trials that left the wire heating. The goals are 1 s with the board's watchdog
and 2 s with the guardian. Behind a pulled cable a supply can only be switched off when the cable is back, so there the
time starts at that moment.

`emulated` is the board whose firmware runs on an emulated microcontroller.

`gateway` is the supply behind a network gateway. Either its connection is half-open when the driver dies, or the
gateway forwards nothing for a while (frozen), and the time starts at the end of that. When driver and guardian are both
killed within 0.3 s, a supply may heat on, because neither could switch it off; such trials are counted too.

"off" is the emergency stop: `smadrive off` is started while the driver runs, stands still (stopped) or hangs, and the
time starts with it. Its start and its confirmation belong to the trial: an `off` that does not confirm is an error.

The machine must be idle: a bench that is slower than real time delays the result itself.
"""

from __future__ import annotations

import argparse
import contextlib
import itertools
import multiprocessing
import os
import random
import re
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from gateway import Gateway
from process_tree import guardians, is_guardian

import firmware_sim.cli
from smadrive.files.shipped import configs_dir
from smadrive.rig.config import load_rig
from smadrive.rig.rig import Rig

PROCESSES = multiprocessing.get_context("forkserver")

SUPPLY = {"supply": "riden-rd60xx", "thermometer": "autonics-tk"}
BOARD = {"board": "sma-reference"}
PROFILES = {"board": BOARD, "emulated": BOARD, "supply": SUPPLY, "gateway": SUPPLY}
SIGNALS = {"killed": signal.SIGKILL, "stopped": signal.SIGSTOP, "terminated": signal.SIGTERM, "Ctrl-C": signal.SIGINT}
BY_SCRIPT = {"cable out for 2 s": ("vanish", "for_s = 2.0", 2.0), "power cycle": ("reboot", "", 0.0)}
BOTH_KILLED = ("driver, then guardian killed", "guardian, then driver killed")
HALF_OPEN = {"half-open, killed": "killed", "half-open, Ctrl-C": "Ctrl-C", "half-open, exception": "exception"}
OFF = ("off", "off, stopped", "off, hung")
FROZEN = "frozen for 2 s"
FROZEN_S = 2.0
FATES = {
    "board": (*SIGNALS, "exception", *BY_SCRIPT, *OFF),
    "emulated": ("killed", "stopped", *BY_SCRIPT),
    "supply": (*SIGNALS, "exception", *BY_SCRIPT, *BOTH_KILLED, *OFF),
    "gateway": (*HALF_OPEN, FROZEN),
}
BETWEEN_S = 0.3
"""Longest time between the deaths of driver and guardian."""
HEATING_TICK = 5
START_S = 30.0
"""Bench and driver have started after this time, even on a busy machine."""

SCRIPT_AT_S = 6.0
SERVED = re.compile(r"^(?:serial|rtu\+tcp)://\S+", re.MULTILINE)
SWITCHED = re.compile(r"(?P<on>\barmed, |output on|heater on)|heater off|output off|disarmed|power-up")
LEFT_AFTER_S = 8.0


def sim_file(kind: str, folder: Path) -> Path:
    """Write the sim file of a bench with its ports in `folder`. Behind a gateway, the supply has a TCP port."""
    sim = folder / "sim.toml"
    text = (configs_dir() / "sims" / "flexinol-lt-0.15mm.toml").read_text()
    if kind == "emulated":
        text = text.replace("[board]\n", '[board]\nimplementation = "atmega328p"\n')
    for name, profile in PROFILES[kind].items():
        behind = kind == "gateway" and name == "supply"
        port = 'rtu_tcp = "127.0.0.1:0"' if behind else f'pty = "{folder}/{name}"'
        text += f'\n[[devices]]\nname = "{name}"\nprofile = "{profile}"\n{port}\n'
    sim.write_text(text)
    return sim


def rig_file(kind: str, folder: Path, urls: list[str]) -> Path:
    """Write the rig file of the devices that are served at `urls`."""
    rig = folder / "rig.toml"
    shipped = (
        configs_dir() / "rigs" / ("simulated.toml" if PROFILES[kind] is BOARD else "bench-supply.toml")
    ).read_text()
    head, _, tail = shipped.partition("\n[[devices]]")
    for (name, profile), url in zip(PROFILES[kind].items(), urls, strict=True):
        head += f'\n[[devices]]\nname = "{name}"\nprofile = "{profile}"\nurl = "{url}"\n\n'
    rig.write_text(f"{head}[limits]{tail.partition('[limits]')[2]}")
    return rig


@contextlib.contextmanager
def through_gateway(kind: str, urls: list[str]) -> Iterator[tuple[Gateway | None, list[str]]]:
    """Yield the gateway in front of the supply, if the rig has a gateway, and the URLs that lead through it."""
    if kind != "gateway":
        yield None, urls
        return
    supply, *others = urls
    with Gateway(int(supply.partition("?")[0].rpartition(":")[2])) as gateway:
        yield gateway, [f"rtu+tcp://127.0.0.1:{gateway.port}", *others]


@contextlib.contextmanager
def orphans_ended(driver: BaseProcess) -> Iterator[None]:
    """End the driver's guardians after the block: a guardian would search for the ended bench forever."""
    started = guardians(driver.pid)
    try:
        yield
    finally:
        for number in filter(is_guardian, started):
            with contextlib.suppress(OSError):
                os.kill(number, signal.SIGKILL)


@contextlib.contextmanager
def process(target: Callable[..., None], *arguments: object, log: Path) -> Iterator[BaseProcess]:
    """A process that ends with the block; its output goes to `log`."""
    log.touch()
    child = PROCESSES.Process(target=logged, args=(log, target, *arguments))
    child.start()
    try:
        yield child
    finally:
        child.kill()
        child.join()


def logged(log: Path, target: Callable[..., None], *arguments: object) -> None:
    """Run `target` with its output in `log`. Ctrl-C works even where a background shell has disabled it."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    with log.open("w") as output:
        os.dup2(output.fileno(), 1)
        os.dup2(output.fileno(), 2)
    target(*arguments)


def serve_bench(*options: str) -> None:
    """Serve the simulated bench by its command."""
    firmware_sim.cli.main(options)


def drive(rig_file: Path, orders: Connection) -> None:
    """Heat the wire, send a message when it is warm, and fail on request."""
    with Rig(load_rig(str(rig_file))) as rig:
        rig.heater.arm(rig.config.limits.watchdog_s)
        for tick in itertools.count():
            rig.heater.exchange(0.2 + 0.05 * (tick % 2))
            if tick == HEATING_TICK:
                orders.send("heating")
            if orders.poll(rig.period_s / 2):
                if orders.recv() == "hang":
                    hang()
                raise ZeroDivisionError("in the controller")


def hang() -> None:
    """Compute without end, and obey no interruption."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    while True:
        pass


def wait_for(log: Path, pattern: re.Pattern[str], seen: int, until_s: float) -> float | None:
    """Return the time at which the log has more than `seen` matches of `pattern`, or None if not before `until_s`."""
    while time.monotonic() < until_s:
        if len(pattern.findall(log.read_text())) > seen:
            return time.monotonic()
        time.sleep(0.002)
    return None


def heats(events: str) -> bool:
    """Return True if the last switching event switched the heater on."""
    switchings = list(SWITCHED.finditer(events))
    return bool(switchings) and switchings[-1]["on"] is not None


def wait_for_off(log: Path, until_s: float) -> float | None:
    """Return the time at which the heater is off, or None if it still heats at `until_s`."""
    while heats(log.read_text()):
        if time.monotonic() > until_s:
            return None
        time.sleep(0.002)
    return time.monotonic()


class EndedEarly(Exception):
    """The heating ended before the fate, because a busy machine delayed a reply or a heartbeat."""


def lasting_trial(kind: str, fate: str, seed: int) -> float | None:
    """Return the result of a trial (see `trial`). Repeat the trial until its driver heats at the moment of its fate."""
    for attempt in itertools.count():
        with contextlib.suppress(EndedEarly):
            return trial(kind, fate, seed + 1_000_000 * attempt)
    raise AssertionError


def trial(kind: str, fate: str, seed: int) -> float | None:
    """Return the time from the fate to zero current, or None if the wire is left heating."""
    generator = random.Random(seed)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        options = [str(sim_file(kind, folder))]
        wait_s = 0.0
        if fate in BY_SCRIPT:
            fault, parameters, wait_s = BY_SCRIPT[fate]
            at_s = SCRIPT_AT_S + generator.random()
            device = next(iter(PROFILES[kind]))
            script = folder / "faults.toml"
            script.write_text(f'[[faults]]\nat_s = {at_s}\nname = "{device}.{fault}"\n{parameters}\n')
            options += ["--faults", str(script)]
        log, driver_log = folder / "bench.log", folder / "driver.log"
        here, there = PROCESSES.Pipe()
        with process(serve_bench, *options, log=log):
            if wait_for(log, SERVED, len(PROFILES[kind]) - 1, time.monotonic() + START_S) is None:
                raise RuntimeError(log.read_text())
            with (
                through_gateway(kind, SERVED.findall(log.read_text())) as (gateway, urls),
                process(drive, rig := rig_file(kind, folder, urls), there, log=driver_log) as driver,
            ):
                there.close()  # then the end of the driver raises EOFError below
                try:
                    here.recv()
                except EOFError:
                    raise EndedEarly from None
                if "fault: " in log.read_text():
                    raise RuntimeError("the fault of the script came before the driver was up: fewer --at-once")
                with orphans_ended(driver):
                    met_s = meet(driver, here, fate, log, generator, gateway)
                    off = begin_off(rig) if fate in OFF else None
                    off_s = wait_for_off(log, met_s + wait_s + LEFT_AFTER_S)
                    if off is not None and off.wait() != 0:
                        raise RuntimeError(f"off ended with {off.returncode}")
        if off_s is None:
            if fate not in BOTH_KILLED:
                print(
                    f"left heating, seed {seed}:\n{log.read_text()}\nthe driver: {driver_log.read_text()}",
                    file=sys.stderr,
                )
            return None
    return max(off_s - met_s - (wait_s if kind == "supply" else 0.0), 0.0)


def meet(
    driver: BaseProcess, orders: Connection, fate: str, log: Path, generator: random.Random, gateway: Gateway | None
) -> float:
    """Apply the fate to the driver, and return the time of it."""
    if fate in BY_SCRIPT:
        met_s = wait_for(log, re.compile("fault: "), 0, time.monotonic() + SCRIPT_AT_S + START_S)
        if met_s is None:
            raise RuntimeError("the bench never came to the fault of its script")
        if not heats(log.read_text().partition("fault: ")[0]):
            raise EndedEarly
        return met_s
    time.sleep(2.0 * generator.random())
    if not (driver.is_alive() and heats(log.read_text())):
        raise EndedEarly
    if gateway is not None and fate == FROZEN:
        gateway.freeze()
        time.sleep(FROZEN_S)
        gateway.thaw()
        return time.monotonic()
    if gateway is not None:
        gateway.strand()
    met_s = time.monotonic()
    if fate in OFF:
        if fate == "off, stopped":
            os.kill(driver.pid or 0, signal.SIGSTOP)
        if fate == "off, hung":
            orders.send("hang")
    elif fate in BOTH_KILLED:
        kill_both(driver, fate, generator)
    elif (end := HALF_OPEN.get(fate, fate)) in SIGNALS:
        os.kill(driver.pid or 0, SIGNALS[end])
    else:
        orders.send("fail")
    return met_s


def begin_off(rig_file: Path) -> subprocess.Popen[bytes]:
    """Start the emergency stop of the rig."""
    return subprocess.Popen([sys.executable, "-m", "smadrive", "off", str(rig_file)], stdout=subprocess.DEVNULL)


def kill_both(driver: BaseProcess, fate: str, generator: random.Random) -> None:
    """Kill driver and guardian, the second at most BETWEEN_S after the first."""
    victims = [driver.pid or 0, *guardians(driver.pid)]
    for pid in victims if fate.startswith("driver") else reversed(victims):
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
        time.sleep(BETWEEN_S * generator.random())


def main() -> None:
    """Run the trials and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=int, default=200)
    parser.add_argument("--rig", choices=tuple(PROFILES), action="append")
    parser.add_argument("--fate", choices=sorted({fate for fates in FATES.values() for fate in fates}), action="append")
    parser.add_argument("--at-once", type=int, default=4)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    PROCESSES.set_forkserver_preload(["firmware_sim.cli", "smadrive.rig.rig"])  # imported before the trials are forked
    seeds = range(arguments.seed, arguments.seed + arguments.trials)
    print(f"{'rig':10}{'fate':30}{'trials':>7}{'median s':>10}{'worst s':>10}{'left heating':>14}")
    for kind in arguments.rig or PROFILES:
        for fate in FATES[kind]:
            if arguments.fate and fate not in arguments.fate:
                continue
            with ThreadPoolExecutor(arguments.at_once) as pool:
                times_s = list(pool.map(partial(lasting_trial, kind, fate), seeds))
            ended_s = [time_s for time_s in times_s if time_s is not None]
            left = len(times_s) - len(ended_s)
            median_s, worst_s = (statistics.median(ended_s), max(ended_s)) if ended_s else (float("nan"),) * 2
            print(f"{kind:10}{fate:30}{len(times_s):7}{median_s:10.2f}{worst_s:10.2f}{left:14}", flush=True)


if __name__ == "__main__":
    main()
