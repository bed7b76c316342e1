"""A fit to the last seconds uses the right rows, keeps the ends of the old model, and its model may drive the wire."""

import os
import select
import signal
import subprocess
import sys
import time
from html import unescape
from multiprocessing import active_children
from multiprocessing.connection import wait

import numpy as np
import pytest
from marks import exhaustive

from smadrive.errors import IdentificationError
from smadrive.stream.samples import COLUMNS
from smadrive.tuning.page.fit import Fitter, fit_wire, heated_loop
from smadrive.tuning.page.panel import banner_html, chips_html
from smadrive.wire.identified_wire import parse_wire
from smadrive.wire.wire_model import travel_mm

SINE = "sine:low_mm=2,high_mm=9,period_s=28"
STARTED_S = 3.0
WRONG_MU_C = 93.0
DRIVEN_UP_C = np.linspace(64.0, 94.0, 400)
"""Rising wire temperatures over the range of the sine."""


def loop_mm(wire):
    """Return the displacement of a wire file's model along `DRIVEN_UP_C` and back."""
    return parse_wire(wire, place="wire").model.simulate(np.concatenate((DRIVEN_UP_C, DRIVEN_UP_C[::-1])))


@pytest.fixture(params=["rig", exhaustive("ruled_rig")])
def tracking(request):
    """A rig that tracks the sine with a model whose heating branch is 3 K too warm."""
    rig = request.getfixturevalue(request.param)
    rig.at(1.0, "shape", key="mu_heating", value=WRONG_MU_C)
    rig.at(2.0, "arm")
    rig.at(STARTED_S, "track", reference=SINE)
    return rig


@pytest.mark.exhaustive
@pytest.mark.parametrize("after_s", [45.0, 148.0])
def test_fit_to_part_of_the_travel_keeps_its_ends_and_can_drive(tracking, true_model, after_s):
    """After 45 s, the last 120 s contain the warm-up. After 148 s they do not, and do not determine a cold wire."""
    wires = []

    def fit():
        wire = tracking.status["tuning"]["wire"]
        fitted = fit_wire(*heated_loop(tracking.page.since(0)[1], 120.0, wire), wire)
        assert not any("halves of the record" in caveat for caveat in fitted.caveats)
        text = fitted.text()
        tracking.page.send({"number": 77, "act": "model", "text": text, "source": "fit", "caveats": fitted.caveats})
        wires.extend((wire, text))

    tracking.do(STARTED_S + after_s, fit)
    tracking.run(until_s=STARTED_S + after_s + 2.0)
    assert tracking.answers[77] is None
    true_mm = true_model.simulate(np.concatenate((DRIVEN_UP_C, DRIVEN_UP_C[::-1])))
    before_mm, fitted_mm = (np.abs(loop_mm(wire) - true_mm).max() for wire in wires)
    assert fitted_mm < 0.5 * before_mm
    cold_mm, hot_mm = travel_mm(parse_wire(wires[1], place="fit").model)
    assert cold_mm == pytest.approx(0.0, abs=0.05)
    assert hot_mm == pytest.approx(12.0, abs=0.05)


DRIFTS = {
    "thermocouple": lambda right, age_s: right + 0.05 * age_s,
    "displacement": lambda right, age_s: right + 0.02 * age_s,
}


@pytest.mark.parametrize("sensor", ["thermocouple", exhaustive("displacement")])
@pytest.mark.exhaustive
def test_fit_to_a_drifting_sensor_keeps_its_warning_in_every_later_model(tracking, sensor):
    """The fitted rules are certified and the residual is small enough, so no other check finds the drift."""
    sensed, fitted = getattr(tracking.device.bench.sensors.faults, sensor), []
    tracking.do(30.0, lambda: sensed.begin("drift", None, lambda reading, age_s: DRIFTS[sensor](reading.right, age_s)))

    def fit():
        wire = tracking.status["tuning"]["wire"]
        found = fit_wire(*heated_loop(tracking.page.since(0)[1], 60.0, wire), wire)
        fitted.extend(found.caveats)
        message = {"number": 77, "act": "model", "text": found.text(), "source": "fit", "caveats": found.caveats}
        tracking.page.send(message)

    tracking.do(90.0, fit)
    tracking.at(92.0, "shape", key="scale", value=12.1)
    tracking.run(until_s=94.0)
    assert tracking.answers[77] is None
    assert "the two halves of the record differ by" in fitted[0]
    status = tracking.status
    assert status["tuning"]["change"] == "scale"
    assert status["tuning"]["caveats"] == fitted
    assert f"warning about the model in force: {fitted[0]}" in unescape(banner_html(status, ""))
    assert 'class="chip warn"><i>model' in chips_html(status, "", late=False, controls=True)


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("act", "at_s", "seconds", "reason"),
    [
        ("track", 25.0, 120.0, "less than one full loop"),
        ("hold", 60.0, 10.0, "the wire moved too little"),
    ],
)
def test_record_without_a_loop_is_refused_with_a_cure(rig, act, at_s, seconds, reason):
    rig.at(1.0, "arm")
    rig.at(2.0, "track", reference=SINE)
    if act == "hold":
        rig.at(at_s - 15.0, "hold")
    rig.run(until_s=at_s)
    with pytest.raises(IdentificationError) as refused:
        heated_loop(rig.page.since(0)[1], seconds, rig.status["tuning"]["wire"])
    assert reason in refused.value.what
    assert refused.value.where == f"the last {seconds:g} s"
    assert "fit again" in refused.value.cure


def test_note_of_a_page_is_added_to_the_events(rig):
    """For example, a note says that a fit has failed. Without the event, other pages would not show it."""
    noted = rig.at(1.0, "note", text="not fitted: the last 120 s cannot be fitted: no loop")
    rig.run(until_s=2.0)
    assert rig.answers[noted] is None
    assert [event for _, event in rig.status["events"]] == ["not fitted: the last 120 s cannot be fitted: no loop"]


def test_empty_record_is_refused():
    with pytest.raises(IdentificationError):
        heated_loop(np.empty((0, len(COLUMNS))), 120.0, "")


PATIENCE_S = 20.0
BUSY = """
import multiprocessing, sys, time
from smadrive.tuning.page.fit import Fitter

if __name__ == "__main__":
    busy = Fitter()._pool.submit(time.sleep, 600.0)
    print(multiprocessing.active_children()[0].pid, flush=True)
    sys.stdin.read()
"""


def test_closing_ends_a_fit_that_runs():
    fitter, others = Fitter(), active_children()
    fitter._pool.submit(time.sleep, 600.0)
    (process,) = (one for one in active_children() if one not in others)
    fitter.close()
    assert wait([process.sentinel], PATIENCE_S)  # not its exit code: the thread of the pool may be the one that gets it


def test_fit_ends_with_a_killed_page_process(tmp_path):
    (tmp_path / "busy.py").write_text(BUSY)
    page = subprocess.Popen(
        [sys.executable, tmp_path / "busy.py"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    with page:
        fit = os.pidfd_open(int(page.stdout.readline()))
        page.kill()
    ended, _, _ = select.select([fit], [], [], PATIENCE_S)
    if not ended:
        signal.pidfd_send_signal(fit, signal.SIGKILL)
    os.close(fit)
    assert ended
