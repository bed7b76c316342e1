"""A run engine, a wire as its device, and the documents of a run, validated by event-model."""

import os
from dataclasses import replace
from pathlib import Path

import pytest

bluesky = pytest.importorskip("bluesky", reason="needs bluesky (extra `test`)")

from bluesky.run_engine import RunEngine  # noqa: E402
from event_model import DocumentNames, schema_validators  # noqa: E402

import smadrive  # noqa: E402
from smadrive.bluesky import SmaWire  # noqa: E402
from smadrive.wire.identified_wire import load_wire  # noqa: E402

SINE = smadrive.sine(low_mm=3, high_mm=7, period_s=20, cycles=1)


def is_off(rig, wire):
    """True if no servo runs and no current flows."""
    return rig.measure().current_a < 0.01 and not wire._servo.is_running


class Documents:
    """The documents of the runs, by their kind. Each was valid when it arrived."""

    def __init__(self):
        self.found = []

    def __call__(self, name, document):
        kind = DocumentNames[name]
        schema_validators[kind].validate(document)
        self.found.append((name, document))

    def of(self, kind):
        return [document for name, document in self.found if name == kind]

    def events(self):
        """The data of all events; those of event pages, too."""
        rows = [event["data"] for event in self.of("event")]
        for page in self.of("event_page"):
            rows += [
                dict(zip(page["data"], values, strict=True)) for values in zip(*page["data"].values(), strict=True)
            ]
        return rows


@pytest.fixture(scope="session")
def engine():
    return RunEngine({})


@pytest.fixture
def documents(engine):
    found = Documents()
    token = engine.subscribe(found)
    yield found
    engine.unsubscribe(token)


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    before = Path.cwd()
    os.chdir(tmp_path_factory.mktemp("logs"))
    with smadrive.open_rig("in-process") as opened:
        yield opened
    os.chdir(before)


def _wire_without_file(identified):
    """The identified wire, without its file: the runs of these tests add to no health record."""
    return replace(load_wire(identified.wire_file), source="")


@pytest.fixture
def wire(rig, identified):
    device = SmaWire(rig, _wire_without_file(identified), name="wire", tolerance_mm=0.2)
    yield device
    device.stop()


@pytest.fixture
def other_wire(rig, identified):
    """A second wire, on a rig of its own, whose logs go into the same folder."""
    with smadrive.open_rig("in-process") as other_rig:
        device = SmaWire(other_rig, _wire_without_file(identified), name="other", tolerance_mm=0.2)
        yield device
        device.stop()
