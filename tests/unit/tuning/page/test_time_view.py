"""The plots look back over the whole session, freeze at a trip, and keep a bounded memory."""

import numpy as np
import pytest

from smadrive.hysteresis import DuhemModel
from smadrive.stream.samples import COLUMNS
from smadrive.tuning.page.view.plots import Plots
from smadrive.tuning.page.view.sample_history import CAPACITY, FULL_ROWS, SampleHistory, reduced
from smadrive.tuning.page.view.time_plots import POINTS, WINDOW_S
from smadrive.tuning.page.view.time_view import TimeView
from tests.unit.tuning.conftest import true_wire

TIME, CURRENT = COLUMNS.index("time_s"), COLUMNS.index("current_a")
PERIOD_S = 0.05
RUNNING = {"fault_type": None, "fault_s": None, "mode": "tracking"}


def samples(first, count):
    rows = np.full((count, len(COLUMNS)), 1.0)
    rows[:, TIME] = PERIOD_S * np.arange(first, first + count)
    return rows


def tripped(fault_s, fault_type="TripError"):
    return {"fault_type": fault_type, "fault_s": fault_s, "mode": "off"}


class Watched:
    """The plots of one page over a session that this test writes."""

    def __init__(self, channel):
        self.history = SampleHistory(channel)
        self.plots = Plots(0.6, 135.0)
        self.plots.show_model(true_wire(), (0.0, 12.0))
        self.view = TimeView(self.plots, self.history)
        self._count = 0

    def run(self, seconds, status=RUNNING):
        for _ in range(round(seconds)):
            rows = samples(self._count, round(1.0 / PERIOD_S))
            self._count += len(rows)
            self.history.add(rows)
            self.view.update(status)
            if self.view.follows:
                self.plots.add(rows)

    @property
    def drawn_s(self):
        return np.asarray(self.plots.time.data["time_s"])


@pytest.fixture
def watched(rig):
    return Watched(rig.page)


def test_memory_is_bounded_and_keeps_the_newest_samples_and_every_spike(rig):
    history = SampleHistory(rig.page)
    block = FULL_ROWS // 4
    for n in range(40):
        rows = samples(n * block, block)
        rows[7, CURRENT] = 10.0 + n
        history.add(rows)
        assert len(history) <= CAPACITY + FULL_ROWS
    assert history.ends_s == (0.0, pytest.approx(PERIOD_S * (40 * block - 1)))
    newest = history.window(PERIOD_S * (40 * block - FULL_ROWS), 1e9, CAPACITY)
    np.testing.assert_allclose(np.diff(newest[-FULL_ROWS:, TIME]), PERIOD_S)
    whole = history.window(*history.ends_s, CAPACITY)
    assert set(range(10, 50)) <= set(whole[:, CURRENT])


def test_reduced_rows_are_few_in_order_and_hold_the_extremes():
    rows = samples(0, 100_000)
    rows[[12_345, 54_321], CURRENT] = 7.0, -3.0
    rows[60_000:70_000, CURRENT] = np.nan
    few = reduced(rows, POINTS)
    assert len(few) <= POINTS
    assert (np.diff(few[:, TIME]) > 0.0).all()
    assert {7.0, -3.0} <= set(few[:, CURRENT])


def test_everything_of_the_minute_before_a_trip_is_shown_ten_minutes_later(watched):
    watched.run(300.0)
    watched.run(600.0, tripped(300.0))
    assert not watched.view.follows
    before = watched.drawn_s[(watched.drawn_s > 240.0) & (watched.drawn_s < 299.99)]
    np.testing.assert_allclose(before, PERIOD_S * np.arange(4801, 6000), atol=1e-6)
    assert watched.drawn_s[-1] >= 303.0
    assert watched.plots.window == pytest.approx((238.0, 303.0))


def test_page_opened_after_a_trip_shows_the_trip(watched):
    watched.history.add(samples(0, 20_000))
    watched.view.update(tripped(300.0))
    assert ((watched.drawn_s > 240.0) & (watched.drawn_s <= 300.0)).sum() >= 1199


def test_plots_follow_again_after_the_next_arm(watched):
    watched.run(100.0)
    watched.run(20.0, tripped(100.0))
    assert not watched.view.follows
    watched.run(5.0)
    assert watched.view.follows
    assert watched.plots.window[1] == pytest.approx(125.0, abs=0.1)


def test_refusal_to_arm_does_not_freeze(watched):
    watched.run(10.0, tripped(5.0, "SafetyError"))
    assert watched.view.follows


def test_resumed_plots_do_not_freeze_again_at_the_same_trip(watched):
    watched.run(100.0)
    watched.run(5.0, tripped(100.0))
    watched.view.follow()
    watched.run(5.0, tripped(100.0))
    assert watched.view.follows


def test_paused_plots_stay_and_resume_at_the_newest_sample(watched):
    watched.run(100.0)
    watched.view._switch()
    window, drawn = watched.plots.window, watched.drawn_s
    watched.run(30.0)
    assert watched.plots.window == window
    np.testing.assert_array_equal(watched.drawn_s[-20:], drawn[-20:])
    watched.view._switch()
    assert watched.plots.window == pytest.approx((130.0 - PERIOD_S - WINDOW_S, 130.0 - PERIOD_S))
    assert watched.drawn_s[-1] == pytest.approx(130.0 - PERIOD_S)


def test_window_that_is_dragged_in_the_browser_is_drawn_and_stops_the_following(watched):
    watched.run(300.0)
    watched.plots._x.update(start=20.0, end=40.0)
    watched.run(1.0)
    assert not watched.view.follows
    assert watched.plots.window == (20.0, 40.0)
    assert ((watched.drawn_s >= 20.0) & (watched.drawn_s <= 40.0)).sum() == pytest.approx(400, abs=2)


def test_back_forward_zoom_and_the_whole_session(watched):
    watched.run(300.0)
    watched.view._move(-0.5)
    assert watched.plots.window == pytest.approx((209.95, 269.95))
    watched.view._zoom(0.5)
    assert watched.plots.window == pytest.approx((224.95, 254.95))
    watched.view.show(*watched.history.ends_s)
    assert watched.plots.window == pytest.approx((0.0, 299.95))
    assert watched.drawn_s.size <= POINTS
    watched.view._move(0.5)
    watched.view._zoom(2.0)
    assert isinstance(watched.plots._model, DuhemModel)


def test_window_begins_at_0_and_grows_to_its_full_length(watched):
    watched.run(12.0)
    assert watched.plots.window == pytest.approx((0.0, 12.0 - PERIOD_S))
    watched.run(60.0)
    assert watched.plots.window == pytest.approx((72.0 - PERIOD_S - WINDOW_S, 72.0 - PERIOD_S))
