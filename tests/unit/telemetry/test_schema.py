"""The messages and the page that describes them agree, and an unknown number is null."""

import json
import re
from math import inf, nan
from pathlib import Path

import pytest

from smadrive.control.controllers.interface import Command
from smadrive.control.loop import Tick
from smadrive.errors import StoppedError, TripError
from smadrive.measurement import Measurement
from smadrive.rig.config import load_rig
from smadrive.rig.rig import Rig
from smadrive.stream.published_state import PublishedMode
from smadrive.stream.samples import COLUMNS
from smadrive.stream.shared_memory import SharedWriter
from smadrive.telemetry.feed import RunFeed
from smadrive.telemetry.schema import (
    FAULTS,
    MESSAGES,
    SAMPLE,
    STATE,
    VERSION,
    faults_message,
    sample_message,
    schema_document,
    state_message,
    topic_of,
)

PAGE = Path(__file__).parents[3] / "docs" / "telemetry.md"
ROW = re.compile(r"^\| `(\w+)` \| ([^|]*) \| ([^|]*) \|$", re.MULTILINE)


@pytest.mark.parametrize("message", MESSAGES)
def test_page_lists_every_field_with_its_unit(message):
    section = PAGE.read_text(encoding="utf-8").partition(f"\n### `{message}`")[2].partition("\n#")[0]
    rows = {name: unit.strip() for name, unit, _ in ROW.findall(section)}
    assert rows == {
        name: field.unit.replace("1", "–").replace("degC", "°C") or "–" for name, field in MESSAGES[message].items()
    }


def test_page_names_the_version():
    assert f"schema version {VERSION}" in PAGE.read_text(encoding="utf-8")


def test_unknown_numbers_are_null():
    message = sample_message(7, 1000.0, [0.25, nan, inf, *[1.23456789] * (len(COLUMNS) - 3)])
    assert tuple(message) == tuple(SAMPLE)
    assert (message["late_s"], message["temperature_c"], message["displacement_mm"]) == (None, None, 1.234568)
    assert (message["number"], message["unix_s"], message["schema"]) == (7, 1000.25, VERSION)
    json.dumps(message, allow_nan=False)


def test_status_of_a_run_has_every_field():
    with SharedWriter() as writer, RunFeed(writer, load_rig("in-process"), PublishedMode.TRACKING) as feed:
        with Rig(load_rig("in-process")) as rig:
            feed.begin(rig)
        assert set(state_message(writer.published, "run")) == set(STATE)
        assert set(faults_message(writer.published)) == set(FAULTS)
        assert faults_message(writer.published)["any"] is False
        for fault in ({"device_faults": ["x"]}, {"supply_fault": "asleep"}, {"latched": "too hot"}):
            assert faults_message({**writer.published, **fault})["any"] is True


def test_fault_of_the_supply_and_latched_trip_are_published():
    config, trip = load_rig("in-process"), TripError("too hot", 1)
    with SharedWriter() as writer, RunFeed(writer, config, PublishedMode.OFF) as feed:
        with Rig(config) as rig:
            rig.latch.latch(trip)
            feed.begin(rig)
        assert faults_message(writer.published)["latched"] == trip.what
        feed.tick(Tick(0.0, 0.0, Measurement(0.0, 20.0, nan, nan, supply_fault="asleep"), Command(0.0)))
        assert faults_message(writer.published)["supply_fault"] == "asleep"


def test_trip_is_latched_at_the_end_of_its_run():
    assert faults_after(TripError("too hot", 1), latches=True)["latched"] == "too hot"


def faults_after(error, *, latches=False):
    """The published faults of a run that `error` has ended. With `latches`, the trip latch of the rig holds it."""
    config = load_rig("in-process")

    def end(writer):
        with RunFeed(writer, config, PublishedMode.TRACKING) as feed:
            with Rig(config) as rig:
                feed.begin(rig)
                if latches:
                    rig.latch.latch(error)
            raise error

    with SharedWriter() as writer:
        with pytest.raises(type(error)):
            end(writer)
        return faults_message(writer.published)


def test_no_limit_holds_the_output_back_after_the_end():
    config = load_rig("in-process")
    with SharedWriter() as writer:
        with RunFeed(writer, config, PublishedMode.TRACKING) as feed:
            with Rig(config) as rig:
                feed.begin(rig)
            feed.tick(Tick(0.0, 0.0, Measurement(0.0, 20.0, 0.1, 1.6, device_limits=("current",)), Command(0.1)))
            assert state_message(writer.published, "run")["limited_by"] == ["current"]
        ended = state_message(writer.published, "run")
    assert (ended["mode"], ended["limited_by"]) == ("off", [])


def stopped(cause):
    error = StoppedError("stopped")
    error.__cause__ = cause
    return error


@pytest.mark.parametrize(
    ("error", "fault_type"),
    [
        (TripError("too hot", 1), "TripError"),
        (stopped(TripError("too hot", 1)), "TripError"),
        (stopped(KeyboardInterrupt()), None),
        (stopped(None), None),
        (KeyboardInterrupt(), None),
    ],
)
def test_fault_that_ended_a_run_is_published(error, fault_type):
    faults = faults_after(error)
    assert (faults["any"], faults["fault_type"]) == (fault_type is not None, fault_type)
    assert (faults["fault"] is None) == (fault_type is None)


def test_topics_have_no_wildcards():
    assert topic_of("smadrive", "wire + laser/#2, left", "sample") == "smadrive/wire-laser-2-left/sample"
    assert topic_of("lab/a", "#", "off") == "lab/a/rig/off"


def test_schema_document_is_json():
    document = json.loads(json.dumps(schema_document(), allow_nan=False))
    assert document["messages"]["sample"]["temperature_c"] == {"unit": "degC", "label": "temperature, measured"}
