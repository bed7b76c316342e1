"""Runs of a wire are read back from a catalogue, with their metadata, as tables along the time."""

import numpy as np
import pytest
from bluesky import plans as bp
from bluesky import preprocessors as bpp

import smadrive

pytestmark = [pytest.mark.exhaustive, pytest.mark.filterwarnings("ignore")]  # warnings of the catalogue's own


def test_scan_and_flight_are_read_back(engine, documents, wire):
    in_memory = pytest.importorskip("databroker.in_memory", reason="needs databroker (extra `test`)")
    catalogue = in_memory.BlueskyInMemoryCatalog()
    (scanned,) = engine(bp.scan([], wire, 2.0, 8.0, 4))
    wire.prepare(smadrive.sine(low_mm=3, high_mm=7, period_s=20, cycles=1))
    (flown,) = engine(bpp.stage_wrapper(bp.fly([wire]), [wire]))
    starts = [number for number, (name, _) in enumerate(documents.found) if name == "start"]
    for first, end in zip(starts, [*starts[1:], None], strict=True):
        run = documents.found[first:end]
        catalogue.upsert(run[0][1], run[-1][1], iter, (run,), {})
    table = catalogue[scanned].primary.read()
    np.testing.assert_allclose(table["wire_displacement_mm"], [2.0, 4.0, 6.0, 8.0], atol=0.2)
    assert catalogue[scanned].metadata["start"]["plan_name"] == "scan"
    flight = catalogue[flown].wire_fly.read()
    assert flight["wire_setpoint_mm"].max() == pytest.approx(7.0, abs=0.01)
    log = smadrive.read_log(wire.log_file)
    assert log["displacement_mm"].max() >= flight["wire_displacement_mm"].max()
