"""The cost of the tuning page: lateness of the loop, time until a change is in force, load of the processors.

    .venv/bin/python tests/benchmarks/tuning.py [--browser | --off]

The loop runs at 50 Hz on a served simulator, in real time and in a process of its own, as in `smadrive tune`. It runs
without a page, with a page, with a page whose user changes something all the time, and while the page process is killed
and restarted. With --browser a chromium shows the page, and its load is measured at 20 Hz with 2,000 points in every
trace. With --off only the time from POST /off to a zero current command is measured, at 20 Hz, while page loads are
pending.

Lateness is from a tick's deadline to its beginning. Device, page, browser and builder share the processors with the
loop. So the benchmark also prints the share of each process, and the time for which the loop was ready but had no
processor. This time depends on the scheduling that the system permits; run the benchmark as an ordinary user to see the
figures of an ordinary user. The simulator
serves TCP: data on a virtual serial port pass through a kernel thread that waits for a processor, and beside a browser
on two cores one exchange in a hundred then takes 18 ms longer, independent of the driver.
"""

import http.client
import json
import os
import secrets
import select
import shutil
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from contextlib import ExitStack, suppress
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from process_tree import children

from smadrive.control.references.shapes import sine
from smadrive.hysteresis import DuhemModel, TriangularSets, TSFuzzyDuhem
from smadrive.real_time import use_real_time_scheduling
from smadrive.rig.config import load_rig, rig_file
from smadrive.rig.rig import Rig
from smadrive.stream.samples import COLUMNS
from smadrive.testing.simulator import ServedSimulator
from smadrive.tuning.link.channel import DriverEnd, PageEnd
from smadrive.tuning.page.view.plots import POINTS
from smadrive.tuning.processes import BuilderProcess, TuningPage
from smadrive.tuning.session.session import TuningSession
from smadrive.tuning.tuning import Tuning
from smadrive.wire.heat_balance import HeatBalance
from smadrive.wire.wire_properties import WireProperties

RATE_HZ, EACH_S = 50.0, 15.0
LOAD_RATE_HZ, LOAD_S = 20.0, 20.0
BALANCE = HeatBalance(0.0298, 0.014, 3.42e-5 * 24200.0, 22.0, 16.5, -0.12, 0.15)
CENTRES = (40.0, 60.0, 65.0, 70.0, 75.0, 80.0, 85.0, 90.0, 95.0, 100.0, 120.0)
WIRE = DuhemModel.gaussian(
    mu_heating=89.9, mu_cooling=69.0, sigma_heating=5.0, sigma_cooling=5.0, scale=12.0, input_range=(0.0, 200.0)
)
CHANGE = struct.Struct("d")
TIME, LATE, CURRENT, COMMANDED = (COLUMNS.index(name) for name in ("time_s", "late_s", "current_a", "commanded_a"))
OFF_RATE_HZ, OFF_TRIALS = 20.0, 5
PENDING_LOADS = (0, 5, 20, 60, 200)


class Ended(BaseException):
    """The exception that ends the session."""


def drive(script, rate_hz):
    """Run the driver: the loop, and a thread that sleeps until the script requests a page, or has ended."""
    with ExitStack() as stack:
        simulator = stack.enter_context(ServedSimulator("flexinol-lt-0.15mm", real_time=True, tcp=True))
        config = load_rig("simulated").at(simulator.url).model_copy(update={"rate_hz": rate_hz})
        builder = stack.enter_context(BuilderProcess())
        channel = stack.enter_context(DriverEnd())
        rig = stack.enter_context(Rig(config))
        tuning = Tuning.of(TSFuzzyDuhem.from_duhem(WIRE, TriangularSets(CENTRES)), config.feedback, "as loaded")
        references = {"sine": sine(low_mm=2.0, high_mm=9.0, period_s=30.0, cycles=1)}
        changes, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
        front, is_ending = PageEnd(channel.memory_fd, channel.page_socket), threading.Event()
        shown = tuning

        def record(_tick):
            nonlocal shown
            front.beat_front()  # a session without a page does not heat
            if session.tunings.in_force is not shown:
                shown = session.tunings.in_force
                changes.send(CHANGE.pack(shown.shape.mu_heating))
            if is_ending.is_set():
                raise Ended

        def attend():
            with ExitStack() as pages:
                for line in child.stdout:
                    if not line.startswith(":"):
                        print(line, end="", flush=True)
                        continue
                    if line == ":open\n":
                        token = secrets.token_urlsafe(8)
                        rig = rig_file("simulated")
                        page = TuningPage(channel, port=0, token=token, rig_file=rig, folder=Path())
                        pages.enter_context(page)
                    child.stdin.write(json.dumps({"url": page.url, "pid": page.server.pid}) + "\n")
                    child.stdin.flush()
                    if line == ":close\n":
                        pages.close()
            is_ending.set()

        session = TuningSession(rig, tuning, WireProperties(BALANCE), references, channel, builder, record)
        fds = (channel.memory_fd, channel.page_socket.fileno(), theirs.fileno())
        processes = {"loop": os.getpid(), "device": simulator._process.pid, "builder": builder.pid}
        parameters = json.dumps({"fds": fds, "rate_hz": rate_hz, "processes": processes})
        child = subprocess.Popen(
            [sys.executable, __file__, *sys.argv[1:], "--script", script, parameters],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            pass_fds=fds,
        )
        attendant = threading.Thread(target=attend)
        attendant.start()
        stand_in_for_hardware(simulator._process.pid)
        use_real_time_scheduling()
        granted = os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK == os.SCHED_FIFO
        print(f"the loop at {rate_hz:g} Hz, {'in real time' if granted else 'as any process'}", flush=True)
        with suppress(Ended):
            session.run()
        attendant.join()
        child.wait()


def stand_in_for_hardware(pid):
    """Give the simulator a higher priority than a browser, if permitted: a board has a processor of its own."""
    for thread in Path(f"/proc/{pid}/task").iterdir():
        with suppress(OSError):
            os.sched_setscheduler(int(thread.name), os.SCHED_FIFO, os.sched_param(2))


class Script:
    """The process of the script: it sends requests as a page does, and reads the rows of the loop."""

    def __init__(self, parameters):
        memory_fd, socket_fd, changes_fd = parameters["fds"]
        self.page = PageEnd(memory_fd, socket.socket(fileno=socket_fd))
        self.changes = socket.socket(fileno=changes_fd)
        self.rate_hz = parameters["rate_hz"]
        self.processes = parameters["processes"]
        self._number = 1_000_000

    def ask(self, act, **values):
        self._number += 1
        self.page.send({"number": self._number, "act": act, **values})

    def command(self, what):
        print(f":{what}", flush=True)
        return json.loads(sys.stdin.readline())

    def heat(self):
        self.ask("arm", offs=self.page.offs)
        time.sleep(2.0)
        self.ask("track", offs=self.page.offs, reference="sine")
        time.sleep(3.0)

    def watch(self, name, action, alone=None):
        """Do something for a while. Print the lateness of the loop during this time, and the load of the processors."""
        first, used, began_s, waited_s = self.page.written, self.used_s(), time.monotonic(), self.waited_s()
        action(began_s + EACH_S)
        took_s = time.monotonic() - began_s
        _, rows = self.page.since(first)
        late_ms = 1e3 * rows[:, LATE]
        skipped, exchange_ms = schedule(rows, 1.0 / self.rate_hz)
        missed = int(np.sum(late_ms > 500.0 / self.rate_hz)) + skipped
        p50, p99 = np.percentile(late_ms, (50, 99))
        ratio = "" if alone is None else f"   p99 {p99 / alone:.2f} x that without a page"
        print(
            f"{name:34s} late {p50:6.3f} ms, p99 {p99:6.3f} ms, worst {late_ms.max():6.3f} ms, {missed} missed of "
            f"{late_ms.size}{ratio}"
        )
        shares = [
            f"{who} {100.0 * (now_s - used.get(who, 0.0)) / took_s:.0f} %" for who, now_s in self.used_s().items()
        ]
        ready_ms = 1e3 * (self.waited_s() - waited_s) / max(late_ms.size, 1)
        print(f"{'':34s} {', '.join(shares)} of a core; ready without one {ready_ms:.3f} ms a tick; ", end="")
        print(f"an exchange up to {np.percentile(exchange_ms, 99):.0f} ms longer than the shortest (p99)", flush=True)
        return float(p99)

    def used_s(self):
        return {
            who: sum(map(cpu_s, pids if isinstance(pids, list) else [pids])) for who, pids in self.processes.items()
        }

    def waited_s(self):
        """Return the time for which the loop's thread was ready but had no processor."""
        loop = self.processes["loop"]
        return int(Path(f"/proc/{loop}/task/{loop}/schedstat").read_text().split()[1]) * 1e-9

    def latencies(self):
        """Measure the time from a knob to the model in the loop, and from OFF to zero measured current."""
        knob_ms = []
        for n in range(20):
            value = 90.0 + 0.1 * (n % 5)
            began_s = time.monotonic()
            self.ask("shape", key="mu_heating", value=value)
            while select.select([self.changes], [], [], 2.0)[0]:
                if CHANGE.unpack(self.changes.recv(CHANGE.size))[0] == value:
                    break
            knob_ms.append(1e3 * (time.monotonic() - began_s))
            time.sleep(0.2)
        print(f"knob to the model in the loop      median {np.median(knob_ms):.0f} ms, worst {max(knob_ms):.0f} ms")
        off_ms = []
        for _ in range(5):
            seen, began_s = self.page.written, time.monotonic()
            self.page.request_off()
            current_a = 1.0
            while not current_a < 0.002:
                time.sleep(0.001)
                seen, rows = self.page.since(seen)
                current_a = rows[-1, CURRENT] if rows.size else current_a
            off_ms.append(1e3 * (time.monotonic() - began_s))
            time.sleep(1.0)
            self.heat()
        print(
            f"OFF to zero current measured       median {np.median(off_ms):.0f} ms, worst {max(off_ms):.0f} ms",
            flush=True,
        )


def lateness(script):
    """Measure the lateness of the loop at 50 Hz in every state of the page."""

    def hammer(end_s):
        while time.monotonic() < end_s:
            for n in range(10):
                script.ask("shape", key="mu_heating", value=89.0 + 0.1 * n)
            time.sleep(0.05)

    def kill(end_s):
        for _ in range(3):
            with suppress(ProcessLookupError):  # it is just being started
                os.kill(script.command("which")["pid"], signal.SIGKILL)
            time.sleep(EACH_S / 3.0)
        until(end_s)

    script.heat()
    alone = script.watch("no page", until)
    script.processes["page"] = script.command("open")["pid"]
    with ExitStack() as stack:
        if "--browser" in sys.argv:
            stack.enter_context(shown(script))
        script.watch("page open", until, alone)
        script.latencies()
        script.watch("page open, changes all the time", hammer, alone)
        del script.processes["page"]
        script.watch("page killed three times", kill, alone)
    script.command("close")
    script.watch("no page again", until, alone)


def load(script):
    """Measure the load of page process and browser."""
    script.heat()
    until(time.monotonic() + POINTS / LOAD_RATE_HZ)
    script.processes["page"] = script.command("open")["pid"]
    with shown(script):
        time.sleep(5.0)
        before, began_s = script.used_s(), time.monotonic()
        time.sleep(LOAD_S)
        took_s = time.monotonic() - began_s
        used = {who: 100.0 * (now_s - before[who]) / took_s for who, now_s in script.used_s().items()}
    print(f"at {LOAD_RATE_HZ:g} Hz, {min(script.page.written, POINTS)} points a trace: ", end="")
    print(f"server {used['page']:.1f} %, browser {used['browser']:.1f} % of a core", flush=True)
    script.command("close")


def off_beside_page_loads(script):
    """Measure the time from POST /off to the first tick that commands no current, while page loads are pending."""
    address = urlsplit(script.command("open")["url"]).netloc
    for count in PENDING_LOADS:
        replied_ms, off_ms = zip(*(off_among(script, address, count) for _ in range(OFF_TRIALS)), strict=True)
        print(
            f"{count:3d} page loads pending: POST /off answered after median {np.median(replied_ms):.0f} ms, "
            f"worst {max(replied_ms):.0f} ms; zero current commanded after median {np.median(off_ms):.0f} ms, "
            f"worst {max(off_ms):.0f} ms",
            flush=True,
        )
    script.command("close")


def off_among(script, address, count):
    """Return the milliseconds from POST /off to its reply, and to the command of zero current."""
    script.heat()
    host, port = address.split(":")
    loads = [socket.create_connection((host, int(port))) for _ in range(count)]
    for load in loads:
        load.sendall(f"GET / HTTP/1.1\r\nHost: {address}\r\n\r\n".encode())
    seen, began_s = script.page.written, time.monotonic()
    off = http.client.HTTPConnection(address)
    off.request("POST", "/off")
    assert off.getresponse().status == http.client.OK
    replied_s = time.monotonic()
    while not (rows := script.page.since(seen)[1]).size or rows[-1, COMMANDED] > 0.0:
        time.sleep(0.001)
    ended_s = time.monotonic()
    for load in loads:
        load.close()
    time.sleep(2.0)
    return 1e3 * (replied_s - began_s), 1e3 * (ended_s - began_s)


class shown:  # noqa: N801
    """Open the page in a chromium during the block."""

    def __init__(self, script):
        self._script = script

    def __enter__(self):
        from playwright.sync_api import sync_playwright

        self._playwright = sync_playwright().start()
        self._browser = self._playwright.chromium.launch(
            executable_path=shutil.which("chromium"), args=["--no-sandbox"]
        )
        page = self._browser.new_page(viewport={"width": 1600, "height": 1000})
        page.goto(self._script.command("which")["url"])
        page.wait_for_timeout(5000)
        chromium = [pid for pid in descendants(os.getpid()) if "chromium" in Path(f"/proc/{pid}/cmdline").read_text()]
        self._script.processes["browser"] = chromium

    def __exit__(self, *error):
        del self._script.processes["browser"]
        self._browser.close()
        self._playwright.stop()


def schedule(rows, period_s):
    """Return the number of missing ticks, and the milliseconds by which exchanges were longer than the shortest one.

    A row has the time of the measurement and the lateness of its tick; their difference is the deadline plus the
    exchange.
    """
    at_s = rows[:, TIME] - rows[:, LATE]
    turn = np.exp(2j * np.pi * at_s / period_s)
    phase = np.angle(turn / turn.mean()) / (2.0 * np.pi)  # in periods, around that of the mean
    longer = phase - phase.min()
    left_out = np.diff(np.round(at_s / period_s - phase)) - 1.0
    return int(left_out.sum()), 1e3 * period_s * longer


def until(end_s):
    time.sleep(max(0.0, end_s - time.monotonic()))


def descendants(pid):
    return [one for child in children(pid) for one in (child, *descendants(child))]


def cpu_s(pid):
    with suppress(OSError):
        fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    return 0.0


if __name__ == "__main__":
    if "--script" in sys.argv:
        {"lateness": lateness, "load": load, "off": off_beside_page_loads}[sys.argv[-2]](
            Script(json.loads(sys.argv[-1]))
        )
    else:
        if "--browser" in sys.argv:
            drive("load", LOAD_RATE_HZ)
        if "--off" in sys.argv:
            drive("off", OFF_RATE_HZ)
        else:
            drive("lateness", RATE_HZ)
        print(json.dumps({"load average": os.getloadavg()}))
