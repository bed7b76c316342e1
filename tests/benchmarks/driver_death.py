"""How soon is the current zero when the driver dies while heating? In real time, on a board and on a supply.

    python tests/benchmarks/driver_death.py [--trials 200] [--rig board|supply]

In every trial the driver heats on a served bench and meets its fate at a random moment; what counts is when the bench
says that the output is off. Printed for each fate: median and worst time, and how often the wire was left heating. The
goals are 1 s with the board's watchdog and 2 s with the guardian; behind a pulled cable a supply can only be switched
off when the cable is back, so there the time runs from then.
"""

from __future__ import annotations

import argparse
import contextlib
import random
import re
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from smadrive.shipped import configs_dir

DRIVER = """
import select, sys
from smadrive.rig import Rig
from smadrive.rigconfig import load_rig
with Rig(load_rig(sys.argv[1])) as rig:
    rig.heater.arm(rig.config.limits.watchdog_s)
    for tick in range(1_000_000):
        rig.heater.exchange(0.2 + 0.05 * (tick % 2))
        if tick == 5:
            print("heating", flush=True)
        if select.select((sys.stdin,), (), (), rig.period_s / 2)[0]:
            raise ZeroDivisionError("in the controller")
"""
PROFILES = {"board": {"board": "sma-reference"}, "supply": {"supply": "riden-rd60xx", "thermometer": "autonics-tk"}}
SIGNALS = {"killed": signal.SIGKILL, "stopped": signal.SIGSTOP, "terminated": signal.SIGTERM, "Ctrl-C": signal.SIGINT}
BY_SCRIPT = {"cable out for 2 s": ("vanish", "for_s = 2.0", 2.0), "power cycle": ("reboot", "", 0.0)}
FATES = (*SIGNALS, "exception", *BY_SCRIPT)
SCRIPT_AT_S = 12.0
OFF = re.compile(r"heater off|output off|disarmed|power-up")
LEFT_AFTER_S = 8.0


def tables(kind: str, folder: Path) -> tuple[Path, Path]:
    """The sim file and the rig file of a bench whose ports lie in `folder`."""
    sim, rig = folder / "sim.toml", folder / "rig.toml"
    sim_text = (configs_dir() / "sims" / "flexinol-lt-0.15mm.toml").read_text()
    rig_text = (configs_dir() / "rigs" / ("simulated.toml" if kind == "board" else "bench-supply.toml")).read_text()
    head, _, tail = rig_text.partition("\n[[devices]]")
    limits = "[limits]" + tail.partition("[limits]")[2]
    for name, profile in PROFILES[kind].items():
        device = f'\n[[devices]]\nname = "{name}"\nprofile = "{profile}"\n'
        sim_text += f'{device}pty = "{folder}/{name}"\n'
        head += f'{device}url = "serial://{folder}/{name}"\n\n'
    sim.write_text(sim_text)
    rig.write_text(head + limits)
    return sim, rig


@contextlib.contextmanager
def process(*arguments: str, log: Path | None = None) -> Iterator[subprocess.Popen[str]]:
    """A Python process that ends with the block."""
    with (
        (log or Path("/dev/null")).open("w") as errors,
        subprocess.Popen(
            [sys.executable, *arguments], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=errors, text=True
        ) as child,
    ):
        try:
            yield child
        finally:
            child.kill()


def wait_for(log: Path, pattern: re.Pattern[str], seen: int, until_s: float) -> float | None:
    """When a new event of this kind appears in the log; None: not before `until_s`."""
    while time.monotonic() < until_s:
        if len(pattern.findall(log.read_text())) > seen:
            return time.monotonic()
        time.sleep(0.002)
    return None


def trial(kind: str, fate: str, chance: random.Random) -> float | None:
    """Seconds from the fate to zero current; None when the wire is left heating."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        sim, rig = tables(kind, folder)
        options = ["-m", "firmware_sim.cli", str(sim)]
        wait_s = 0.0
        if fate in BY_SCRIPT:
            fault, parameters, wait_s = BY_SCRIPT[fate]
            at_s = SCRIPT_AT_S + chance.random()
            device = next(iter(PROFILES[kind]))
            script = folder / "faults.toml"
            script.write_text(f'[[faults]]\nat_s = {at_s}\nname = "{device}.{fault}"\n{parameters}\n')
            options += ["--faults", str(script)]
        log, said = folder / "bench.log", folder / "driver.log"
        with process(*options, log=log) as bench:
            for _ in PROFILES[kind]:
                answer(bench, log)
            with process("-c", DRIVER, str(rig), log=said) as driver:
                answer(driver, said)
                off_before = len(OFF.findall(log.read_text()))
                met_s = meet(driver, fate, log, chance)
                off_s = wait_for(log, OFF, off_before, met_s + wait_s + LEFT_AFTER_S)
    if off_s is None:
        return None
    return max(off_s - met_s - (wait_s if kind == "supply" else 0.0), 0.0)


def answer(child: subprocess.Popen[str], log: Path) -> None:
    """Wait for a line of the child; its log is the error when it ends instead."""
    if child.stdout is None or not child.stdout.readline():
        raise RuntimeError(log.read_text())


def meet(driver: subprocess.Popen[str], fate: str, log: Path, chance: random.Random) -> float:
    """Let the driver meet its fate; when it did."""
    if fate in BY_SCRIPT:
        met_s = wait_for(log, re.compile("fault: "), 0, time.monotonic() + SCRIPT_AT_S + 5.0)
        if met_s is None:
            raise RuntimeError("the bench never came to the fault of its script")
        return met_s
    time.sleep(2.0 * chance.random())
    met_s = time.monotonic()
    if fate in SIGNALS:
        driver.send_signal(SIGNALS[fate])
    elif driver.stdin is not None:
        driver.stdin.write("x\n")
        driver.stdin.flush()
    return met_s


def main() -> None:
    """Run the trials and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=int, default=200)
    parser.add_argument("--rig", choices=tuple(PROFILES), action="append")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    chance = random.Random(arguments.seed)
    print(f"{'rig':8}{'fate':20}{'trials':>7}{'median s':>10}{'worst s':>10}{'left heating':>14}")
    for kind in arguments.rig or PROFILES:
        for fate in FATES:
            times_s = [trial(kind, fate, chance) for _ in range(arguments.trials)]
            ended_s = [time_s for time_s in times_s if time_s is not None]
            left = len(times_s) - len(ended_s)
            median_s, worst_s = (statistics.median(ended_s), max(ended_s)) if ended_s else (float("nan"),) * 2
            print(f"{kind:8}{fate:20}{len(times_s):7}{median_s:10.2f}{worst_s:10.2f}{left:14}", flush=True)


if __name__ == "__main__":
    main()
