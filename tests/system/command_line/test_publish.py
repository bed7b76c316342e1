"""`--publish`: the samples are those of the log, an absent broker changes nothing, and `off` stops the command."""

import json
import subprocess
import sys
from contextlib import contextmanager
from itertools import pairwise

import numpy as np
import programs
import pytest
from peers import mosquitto
from peers.mosquitto import MosquittoBroker, Subscriber, free_port, wait_for
from served import PATIENT, served

from smadrive.errors import StoppedError
from smadrive.files.shipped import configs_dir
from smadrive.rig.config import load_rig
from smadrive.rig.rig import Rig
from smadrive.runs.log.reader import read_log

needs_broker = pytest.mark.skipif(mosquitto.missing() is not None, reason=str(mosquitto.missing()))


def smadrive(*arguments, cwd):
    command = [sys.executable, "-m", "smadrive", *map(str, arguments)]
    return programs.run(command, cwd=cwd, capture_output=True, text=True, check=False)


@contextmanager
def started(*arguments, cwd):
    """Start a command. If the test fails, kill it: it would not end by itself."""
    options = {"cwd": cwd, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with programs.Program([sys.executable, "-m", "smadrive", *arguments], **options) as program:
        try:
            yield program
        except BaseException:
            program.kill()
            raise


def real_time_rig(folder, port, **keys):
    """Write a rig file for the simulator that is served at `port`."""
    text = (configs_dir() / "rigs" / "simulated.toml").read_text().replace(load_rig("simulated").devices[0].url, port)
    lines = "".join(f"{key} = {value}\n" for key, value in keys.items())
    (folder / "rig.toml").write_text(lines + text)
    return "rig.toml"


def modes_of(subscriber):
    return [json.loads(text)["mode"] for text in subscriber.texts("state")]


@needs_broker
def test_published_samples_are_those_of_the_log(tmp_path):
    with MosquittoBroker(tmp_path) as broker, Subscriber(broker) as subscriber:
        step = ("--current", 0.2, "--for", 5)
        done = smadrive("heat", "in-process", *step, "--json", "--publish", broker.url, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        assert json.loads(done.stdout)["published"]["samples"] == 101
        wait_for(lambda: subscriber.texts("driver")[-1:] == ["ended"])
        samples = [json.loads(text) for text in subscriber.texts("sample")]
        modes = modes_of(subscriber)
    log = read_log(tmp_path / "heat.h5")
    for name in ("time_s", "temperature_c", "displacement_mm", "commanded_a"):
        np.testing.assert_allclose([sample[name] for sample in samples], log.column(name), atol=1e-6)
    assert [modes[0], modes[-1]] == ["off", "off"]
    assert {*modes} <= {"off", "heating"}  # a state of a run in virtual time may last too short to be published


@pytest.mark.exhaustive
def test_absent_broker_changes_nothing(tmp_path):
    step, url = ("--current", 0.2, "--for", 5), f"mqtt://127.0.0.1:{free_port()}"
    done = smadrive("heat", "in-process", *step, "--json", "--publish", url, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert (result["ticks"], result["published"]["samples"], result["published"]["waiting"]) == (101, 0, 101)
    assert result["published"]["trouble"]
    done = smadrive("heat", "in-process", *step, "--publish", url, cwd=tmp_path)
    assert f"nothing was published to {url}" in done.stdout
    assert done.stderr == ""


def test_wrong_address_starts_nothing(tmp_path):
    done = smadrive("heat", "in-process", "--current", 0.1, "--for", 1, "--publish", "http://x", cwd=tmp_path)
    assert done.returncode == 2
    assert list(tmp_path.iterdir()) == []


def test_request_within_the_program_stops_the_driver():
    with pytest.raises(StoppedError, match="another way"):
        measure_after_request("another way")


def measure_after_request(by):
    with Rig(load_rig("in-process")) as rig:
        rig.stop.request(by)
        rig.measure()


@needs_broker
@pytest.mark.exhaustive
def test_tuning_session_is_published_and_stopped(tmp_path, identified):
    pytest.importorskip("bokeh", reason="needs the extra `tune`")
    with (
        served("--pty", str(tmp_path / "port")) as (_, url),
        MosquittoBroker(tmp_path) as broker,
        Subscriber(broker) as subscriber,
    ):
        rig = real_time_rig(tmp_path, url + PATIENT, off_by_mqtt="true")
        options = ["--model", str(identified.wire_file), "--no-browser", "--port", "0", "--publish", broker.url]
        with started("tune", rig, *options, cwd=tmp_path) as program:
            wait_for(lambda: len(subscriber.texts("sample")) > 20)
            subscriber.publish("smadrive/simulated-bench/off")
            _, errors = program.communicate()
        assert program.returncode == 4, errors
        wait_for(lambda: subscriber.texts("driver")[-1:] == ["ended"])
        states = [json.loads(text) for text in subscriber.texts("state")]
    assert {state["command"] for state in states} == {"tune"}
    assert (states[0]["mode"], states[-1]["end"]) == ("off", "off")
    samples = [json.loads(text) for text in subscriber.texts("sample")]
    assert [sample["number"] for sample in samples] == list(range(len(samples)))
    assert all(abs(later["unix_s"] - sample["unix_s"] - 0.05) < 1.0 for sample, later in pairwise(samples))


@needs_broker
@pytest.mark.exhaustive
@pytest.mark.parametrize("is_permitted", [True, False])
def test_off_from_the_broker_stops_a_command(tmp_path, is_permitted):
    with (
        served("--pty", str(tmp_path / "port")) as (_, url),
        MosquittoBroker(tmp_path) as broker,
        Subscriber(broker) as subscriber,
    ):
        rig = real_time_rig(tmp_path, url + PATIENT, off_by_mqtt=str(is_permitted).lower())
        command = ["heat", rig, "--current", "0.2", "--for", "60" if is_permitted else "4", "--publish", broker.url]
        with started(*command, cwd=tmp_path) as program:
            wait_for(lambda: len(subscriber.texts("sample")) > 20 and "heating" in modes_of(subscriber))
            subscriber.publish("smadrive/simulated-bench/off", "PRESS")
            _, errors = program.communicate()
        assert program.returncode == (4 if is_permitted else 0)
        assert ("confirmed" in errors) == is_permitted
        wait_for(lambda: subscriber.texts("driver")[-1:] == ["ended"])
        assert json.loads(subscriber.texts("state")[-1])["end"] == "off"
    assert read_log(tmp_path / "heat.h5").column("time_s")[-1] < 50.0
