"""A tuning session on a served simulator, its page in a process of its own, and Debian's chromium.

The page is watched in real time, but the loop must not depend on how busy the machine is: the session runs on a paced
clock, on which no tick is ever late.
"""

import secrets
import shutil
import threading
import time
from contextlib import ExitStack, contextmanager, suppress

import pytest

from smadrive.control.references.shapes import sine
from smadrive.hysteresis import DuhemModel, TriangularSets, TSFuzzyDuhem
from smadrive.rig.config import load_rig, rig_file
from smadrive.rig.rig import Rig
from smadrive.testing.simulator import ServedSimulator
from smadrive.tuning.link.channel import DriverEnd, PageEnd
from smadrive.tuning.processes import BuilderProcess, TuningPage
from smadrive.tuning.session.session import TuningSession
from smadrive.tuning.tuning import Tuning
from smadrive.wire.heat_balance import HeatBalance
from smadrive.wire.identified_resistance import WireResistance
from smadrive.wire.wire_properties import WireProperties

CHROMIUM = shutil.which("chromium")
BALANCE = HeatBalance(0.0298, 0.014, 3.42e-5 * 24200.0, 22.0, 16.5, -0.12, 0.15)
RESISTANCE = WireResistance(22.0, 16.5, 0.0, 0.0, 0.004, 0.001, 0.01, (20.0, 80.0, 140.0), (14.52,) * 3)
WIRE = WireProperties(BALANCE, RESISTANCE)
PATIENCE_S = 300.0
"""A test fails after this time if an expected change does not come. Usually the change comes within a second."""


class PacedClock:
    """A clock with the virtual time of a simulator, which runs no faster than real time."""

    def __init__(self, virtual):
        self._virtual = virtual
        self.now_s = virtual.now_s

    def sleep_until(self, time_s):
        time.sleep(max(0.0, time_s - self.now_s()))
        self._virtual.sleep_until(time_s)


class Ended(BaseException):
    """The exception that ends a session, as Ctrl-C does."""


class Session:
    """The driver in a thread of the test: `ticks` are those of the loop, `session` is the session itself."""

    def __init__(self, folder):
        self.ticks = []
        self._is_ending = False
        self.folder = folder

    def __enter__(self):
        self._stack = ExitStack()
        simulator = self._stack.enter_context(ServedSimulator("flexinol-lt-0.15mm"))
        rig = Rig(load_rig("simulated").at(simulator.url), PacedClock(simulator.clock))
        self.rig = self._stack.enter_context(rig)
        self.channel = channel = self._stack.enter_context(DriverEnd())
        builder = self._stack.enter_context(BuilderProcess())
        tuning = Tuning.of(rules(), self.rig.config.feedback, "as loaded")
        references = {"sine": sine(low_mm=2.0, high_mm=9.0, period_s=30.0, cycles=1)}
        self.session = TuningSession(self.rig, tuning, WIRE, references, channel, builder, self._record)
        self.page = TuningPage(
            channel, port=0, token=secrets.token_urlsafe(8), rig_file=rig_file("simulated"), folder=self.folder
        )
        self._stack.enter_context(self.page)
        self._thread = threading.Thread(target=self._run)
        self._thread.start()
        return self

    def __exit__(self, *error):
        self._is_ending = True
        self._thread.join(PATIENCE_S)
        self._stack.close()

    def _run(self):
        with suppress(Ended):
            self.session.run()

    def _record(self, tick):
        self.ticks.append((time.monotonic(), tick))
        if self._is_ending:
            raise Ended

    def switch_off(self):
        PageEnd(self.channel.memory_fd, self.channel.page_socket).request_off()
        self.wait(lambda: self.ticks and not self.session.mode.heats and self.current_a < 0.002)

    @property
    def published(self):
        """The status that the page gets: mode, faults, events and more."""
        _, status = PageEnd(self.channel.memory_fd, self.channel.page_socket).status(-1)
        return {name: status[name] for name in ("mode", "fault", "lost", "events")}

    @property
    def in_force(self):
        return self.session.tunings.in_force

    @property
    def time_s(self):
        """The time of the session. On a busy machine it runs slower than real time."""
        return self.ticks[-1][1].measurement.time_s

    @property
    def current_a(self):
        return self.ticks[-1][1].measurement.current_a

    def wait(self, condition):
        """Wait until `condition()` holds; fails after PATIENCE_S."""
        give_up_s = time.monotonic() + PATIENCE_S
        while not condition():
            assert time.monotonic() < give_up_s, f"not within {PATIENCE_S:g} s: {self.published}"
            time.sleep(0.01)


def rules():
    true = DuhemModel.gaussian(
        mu_heating=89.9, mu_cooling=69.0, sigma_heating=5.0, sigma_cooling=5.0, scale=12.0, input_range=(0.0, 200.0)
    )
    sets = TriangularSets((40.0, 60.0, 65.0, 70.0, 75.0, 80.0, 85.0, 90.0, 95.0, 100.0, 120.0))
    return TSFuzzyDuhem.from_duhem(true, sets)


@pytest.fixture(scope="module")
def lasting_session(tmp_path_factory):
    with Session(tmp_path_factory.mktemp("saved")) as session:
        yield session


@pytest.fixture
def live(lasting_session):
    """A running session. The heater is off at the beginning."""
    lasting_session.switch_off()
    return lasting_session


@pytest.fixture(scope="module")
def browser():
    """Chromium. Its event loop runs in the main thread while it is open, so it is closed before other modules run."""
    playwright = pytest.importorskip("playwright.sync_api", reason="needs playwright (PyPI)")
    if CHROMIUM is None:
        pytest.skip("needs chromium (Debian package chromium)")
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield browser
        browser.close()


@contextmanager
def patient_context(browser, **options):
    """A context of the browser whose pages wait for up to `PATIENCE_S`, as the other waits of these tests do."""
    with browser.new_context(**options) as context:
        context.set_default_timeout(1000 * PATIENCE_S)
        yield context


@pytest.fixture(scope="module")
def context(browser):
    """One context for all pages: its cache holds the scripts of the page."""
    with patient_context(browser, viewport={"width": 1280, "height": 800}) as context:
        yield context


@pytest.fixture
def client(context, live):
    """Opens pages of the session: `client()` one that may control, `client(token=False)` one that only watches."""
    pages = []

    def opened(*, token=True, says=None):
        page = context.new_page()
        pages.append(page)
        page.requests = []
        page.on("request", lambda request: page.requests.append(request.url))
        page.goto(live.page.url if token else live.page.url.split("?")[0])
        page.get_by_text(says or ("controls" if token else "watches"), exact=True).wait_for()
        return page

    yield opened
    for page in pages:
        page.close()
