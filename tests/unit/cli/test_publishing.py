"""The counts that a command prints at the end of its publication. If the print fails, the run keeps its error."""

import sys
from pathlib import Path

import pytest
from peers import mosquitto
from peers.mosquitto import MosquittoBroker, free_port

from smadrive.cli.live.publishing import open_publication
from smadrive.cli.terminal.output import Output
from smadrive.cli.terminal.stdout import open_stdout
from smadrive.errors import ConfigError, TripError
from smadrive.rig.config import load_rig
from smadrive.stream.shared_memory import SharedWriter


@pytest.fixture
def fill_disk(monkeypatch):
    """A function that lets every later write to standard output fail."""
    for name in ("stdin", "stdout", "stderr"):
        monkeypatch.setattr(sys, name, getattr(sys, name))
    with Path("/dev/full").open("w") as full:

        def fill():
            sys.stdout = full
            open_stdout()

        yield fill


def publish(action, url=None):
    url = url or f"mqtt://127.0.0.1:{free_port()}"
    with SharedWriter() as writer, open_publication(url, load_rig("in-process"), "run", writer, Output(False)):
        action()


def test_trip_comes_before_the_counts_that_cannot_be_printed(fill_disk):
    trip = TripError("trip", 3)

    def end():
        fill_disk()
        raise trip

    with pytest.raises(TripError) as raised:
        publish(end)
    assert raised.value is trip


@pytest.mark.exhaustive
def test_counts_that_cannot_be_printed_are_an_error_without_another_one(fill_disk):
    with pytest.raises(ConfigError) as raised:
        publish(fill_disk)
    assert raised.value.where == "standard output"


@pytest.mark.exhaustive
@pytest.mark.skipif(mosquitto.missing() is not None, reason=str(mosquitto.missing()))
def test_broker_is_not_blamed_if_nothing_was_measured(tmp_path, capsys):
    """As when another program drives the rig, so the command ends before its first sample."""
    with MosquittoBroker(tmp_path) as broker:
        publish(lambda: None, broker.url)
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 2
    assert not any(line.startswith("warning") for line in lines)
