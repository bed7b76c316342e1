"""A session adds its adapted loop to the health record of its wire, and shows the health on the page."""

import numpy as np
import pytest

from smadrive.rig.config import FeedbackConfig
from smadrive.runs.health.assessment import assess
from smadrive.runs.health.entries import loop_shape
from smadrive.runs.health.recording import record_health
from smadrive.runs.log.reader import read_log
from smadrive.runs.metrics.tracking_error import error_percent
from smadrive.runs.run_log import WIRE_FILE, record_session
from smadrive.tuning.page.panel import banner_html
from smadrive.wire.health.drift import HealthVerdict, wire_health
from smadrive.wire.health.entry import IDENTIFICATION, Estimate, HealthEntry
from smadrive.wire.health.record import read_health
from smadrive.wire.identified_wire import IdentifiedWire
from tests.unit.tuning.conftest import BALANCE


def drifted():
    """The health of a wire whose heating branch has moved by 2 K."""

    def entry(kind, heating_c):
        return HealthEntry(kind=kind, begun="", model="a", cycles=5.0, heating_c=Estimate(heating_c, 0.1))

    entries = [entry(IDENTIFICATION, 90.0), entry("tracking", 92.0), entry("tracking", 92.0)]
    return wire_health(entries, (1.0, 4.0, 4.0, 1.0), 1.0)


def test_page_warns_about_a_drifted_wire(ruled_rig):
    health = drifted()
    assert health.verdict is HealthVerdict.IDENTIFY_AGAIN
    ruled_rig.do(1.0, lambda: ruled_rig.session.note_health(health))
    ruled_rig.run(until_s=2.0)
    assert ruled_rig.status["wire_warning"] == str(health)
    assert any(str(health) in text for _, text in ruled_rig.status["events"])
    assert str(health) in banner_html(ruled_rig.status, "")


@pytest.mark.exhaustive
def test_session_has_no_tracking_error(ruled_rig, tmp_path):
    """Steps, trials of tunings and other references of a session are not the wear of its wire."""
    wire_file, log_file = tmp_path / "wire.json", tmp_path / "session.h5"
    wire = IdentifiedWire(ruled_rig.model, BALANCE)
    wire.save(wire_file)
    ruled_rig.recording = lambda rig: record_session(log_file, rig, wire, **{WIRE_FILE: str(wire_file)})
    ruled_rig.at(1.0, "arm")
    ruled_rig.at(2.0, "track", reference="sine")
    ruled_rig.run(until_s=30.0)
    assert np.isfinite(error_percent(read_log(log_file))).any()
    record_health(log_file)
    _, session = read_health(wire_file).entries
    assert session.kind == "tuning"
    assert np.isnan((session.rms_percent, session.max_percent)).all()
    assert np.isfinite(session.model_percent)


@pytest.mark.exhaustive
def test_adapted_loop_is_recorded(ruled_rig, tmp_path):
    wire_file, log_file = tmp_path / "wire.json", tmp_path / "session.h5"
    wire = IdentifiedWire(ruled_rig.model, BALANCE)
    wire.save(wire_file)
    ruled_rig.recording = lambda rig: record_session(log_file, rig, wire, **{WIRE_FILE: str(wire_file)})
    ruled_rig.at(1.0, "arm")
    ruled_rig.at(4.0, "track", reference="sine")
    ruled_rig.at(10.0, "adapt", on=True)
    ruled_rig.do(15.0, lambda: ruled_rig.device.bench.plant.ageing.age_wire(shift_c=2.0, over_s=1.0, fade=0.03))
    ruled_rig.run(until_s=200.0)
    assert record_health(log_file) == ()
    (session,) = (entry for entry in read_health(wire_file).entries if not entry.is_identification)
    in_force = ruled_rig.session.tunings.in_force.model
    assert session.kind == "tuning"
    assert session.adapted == pytest.approx(loop_shape(in_force, ruled_rig.model))
    moved = assess(wire_file, FeedbackConfig()).health.adapted_moved
    assert moved.stroke_percent == pytest.approx(100.0 * (in_force.scale / ruled_rig.model.scale - 1.0))
    assert session.heating_c.value - read_health(wire_file).entries[0].heating_c.value == pytest.approx(
        2.0, abs=3 * session.heating_c.error
    )
