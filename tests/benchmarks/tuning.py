"""What the tuning page costs: the punctuality of the loop beside it, the time a change takes, the load it makes.

    .venv/bin/python tests/benchmarks/tuning.py [--browser]

The loop runs at 50 Hz on a served simulator, in real time: without a page, with one, with one that is asked for changes
all the time, and while the page is killed and comes back. With --browser a chromium shows the page (5 traces and more).
"""

import json
import os
import secrets
import shutil
import signal
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, suppress
from pathlib import Path

import numpy as np

from smadrive.control.reference import sine
from smadrive.hysteresis import DuhemModel, TriangularSets, TSFuzzyDuhem
from smadrive.rig import Rig
from smadrive.rigconfig import load_rig, rig_file
from smadrive.testing.simulator import ServedSimulator
from smadrive.thermal import HeatBalance
from smadrive.tuning.channel import ControlEnd, PageEnd
from smadrive.tuning.process import PageProcess
from smadrive.tuning.session import TuningSession
from smadrive.tuning.tuning import Tuning

RATE_HZ, EACH_S = 50.0, 15.0
BALANCE = HeatBalance(0.0298, 0.014, 3.42e-5 * 24200.0, 22.0, 16.5, -0.12, 0.15)
CENTRES = (40.0, 60.0, 65.0, 70.0, 75.0, 80.0, 85.0, 90.0, 95.0, 100.0, 120.0)
WIRE = DuhemModel.gaussian(
    mu_heating=89.9, mu_cooling=69.0, sigma_heating=5.0, sigma_cooling=5.0, scale=12.0, input_range=(0.0, 200.0)
)


class Ended(BaseException):
    """Ends the session."""


class Bench:
    """A session in the main thread's place; the script runs in a thread that stands for the page."""

    def __init__(self, stack, rate_hz):
        sys.setswitchinterval(0.0005)
        simulator = stack.enter_context(ServedSimulator("flexinol-lt-0.15mm", real_time=True))
        config = load_rig("simulated").at(simulator.url).model_copy(update={"rate_hz": rate_hz})
        self.rig = stack.enter_context(Rig(config))
        self.channel = stack.enter_context(ControlEnd())
        self.page = PageEnd(self.channel.memory_fd, self.channel.page_socket)
        workshop = stack.enter_context(ThreadPoolExecutor(1))
        tuning = Tuning.of(TSFuzzyDuhem.from_duhem(WIRE, TriangularSets(CENTRES)), config.feedback, "as loaded")
        references = {"sine": sine(low_mm=2.0, high_mm=9.0, period_s=30.0, cycles=1)}
        self.ticks = []
        self.is_ending = False
        self.session = TuningSession(self.rig, tuning, BALANCE, references, self.channel, workshop, self._record)
        self._number = 0

    def _record(self, tick):
        self.ticks.append((time.monotonic(), tick.late_s, tick.measurement.current_a))
        if self.is_ending:
            raise Ended

    def run(self, script):
        thread = threading.Thread(target=self._scripted, args=(script,))
        thread.start()
        with suppress(Ended):
            self.session.run()
        thread.join()

    def _scripted(self, script):
        try:
            script(self)
        finally:
            self.is_ending = True

    def ask(self, act, **values):
        self._number += 1
        self.page.send({"number": self._number, "act": act, **values})

    def late_ms(self, from_s):
        return 1e3 * np.array([late for stamp, late, _ in self.ticks if stamp >= from_s])


def heat(bench):
    bench.ask("arm")
    time.sleep(2.0)
    bench.ask("track", reference="sine")
    time.sleep(3.0)


def punctuality(bench, name, action, alone=None):
    began_s = time.monotonic()
    action(began_s + EACH_S)
    late_ms = bench.late_ms(began_s)
    p50, p99 = np.percentile(late_ms, (50, 99))
    ratio = "" if alone is None else f"   p99 {p99 / alone:.2f} x that without a page"
    missed = int(np.sum(late_ms > 500.0 / RATE_HZ))
    print(f"{name:34s} late {p50:6.3f} ms, p99 {p99:6.3f} ms, {missed} missed of {late_ms.size}{ratio}", flush=True)
    return float(p99)


def until(end_s):
    time.sleep(max(0.0, end_s - time.monotonic()))


def latencies(bench):
    """From the request to what it does: a knob to the model in the loop, OFF to zero current measured."""
    knob_ms = []
    for n in range(20):
        value = 90.0 + 0.1 * (n % 5)
        began_s = time.monotonic()
        bench.ask("shape", key="mu_heating", value=value)
        while bench.session.bench.in_force.shape.mu_heating != value and time.monotonic() < began_s + 2.0:
            time.sleep(0.001)
        knob_ms.append(1e3 * (time.monotonic() - began_s))
        time.sleep(0.2)
    print(f"knob to the model in the loop      median {np.median(knob_ms):.0f} ms, worst {max(knob_ms):.0f} ms")
    off_ms = []
    for _ in range(5):
        began_s = time.monotonic()
        bench.page.request_off()
        while bench.ticks[-1][0] < began_s or bench.ticks[-1][2] > 0.002:
            time.sleep(0.001)
        off_ms.append(1e3 * (time.monotonic() - began_s))
        time.sleep(1.0)
        heat(bench)
    print(f"OFF to zero current measured       median {np.median(off_ms):.0f} ms, worst {max(off_ms):.0f} ms")


def script(bench):
    def hammer(end_s):
        while time.monotonic() < end_s:
            for n in range(10):
                bench.ask("shape", key="mu_heating", value=89.0 + 0.1 * n)
            time.sleep(0.05)

    heat(bench)
    alone = punctuality(bench, "no page", until)
    process = PageProcess(
        bench.channel, port=0, token=secrets.token_urlsafe(8), rig_file=rig_file("simulated"), folder=Path()
    )
    with process, ExitStack() as stack:
        if "--browser" in sys.argv:
            stack.enter_context(shown(process))
        punctuality(bench, "page open", until, alone)
        punctuality(bench, "page open, changes all the time", hammer, alone)

        def kill(end_s):
            for _ in range(3):
                os.kill(process.pid, signal.SIGKILL)
                time.sleep(EACH_S / 3.0)
            until(end_s)

        punctuality(bench, "page killed three times", kill, alone)
    latencies(bench)


class shown:  # noqa: N801
    """A chromium on the page; its load and the server's, in percent of a core."""

    def __init__(self, process):
        self._process = process

    def __enter__(self):
        from playwright.sync_api import sync_playwright

        self._playwright = sync_playwright().start()
        self._browser = self._playwright.chromium.launch(
            executable_path=shutil.which("chromium"), args=["--no-sandbox"]
        )
        page = self._browser.new_page(viewport={"width": 1600, "height": 1000})
        page.goto(self._process.url)
        page.wait_for_timeout(5000)
        browser = [pid for pid in children(os.getpid()) if "chromium" in Path(f"/proc/{pid}/cmdline").read_text()]
        before, began_s = [cpu_s(pid) for pid in (self._process.pid, *browser)], time.monotonic()
        page.wait_for_timeout(10000)
        took_s = time.monotonic() - began_s
        spent = [
            100.0 * (cpu_s(pid) - was) / took_s for pid, was in zip((self._process.pid, *browser), before, strict=True)
        ]
        print(f"server {spent[0]:.1f} %, browser {sum(spent[1:]):.1f} % of a core", flush=True)

    def __exit__(self, *error):
        self._browser.close()
        self._playwright.stop()


def children(pid):
    found = []
    for task in Path(f"/proc/{pid}/task").glob("*/children"):
        for child in map(int, task.read_text().split()):
            found += [child, *children(child)]
    return found


def cpu_s(pid):
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


if __name__ == "__main__":
    with ExitStack() as everything:
        Bench(everything, RATE_HZ).run(script)
    print(json.dumps({"load average": os.getloadavg()}))
