"""A publication against a real broker: no sample is lost, and `off` acts only where the rig file permits it."""

import json
import os
import signal
import subprocess
import threading

import pytest
from peers import mosquitto
from peers.mosquitto import MosquittoBroker, Subscriber, wait_for

from smadrive.errors import TripError
from smadrive.safety.faults import Fault, Trip
from smadrive.stream.shared_memory import CAPACITY

from .conftest import CONFIG, Published

pytestmark = pytest.mark.skipif(mosquitto.missing() is not None, reason=str(mosquitto.missing()))
TOPIC = "smadrive/simulated-bench-in-process"


@pytest.fixture
def broker(tmp_path):
    with MosquittoBroker(tmp_path) as running:
        yield running


def numbers(subscriber):
    return [json.loads(text)["number"] for text in subscriber.texts("sample")]


def test_every_sample_arrives_and_the_last_state_is_retained(broker):
    with Subscriber(broker) as subscriber:
        published = Published(broker.url)
        with pytest.raises(TripError):
            tripped(published)
        wait_for(lambda: len(numbers(subscriber)) >= 151)  # the broker has them, but passes them on in its own time
    assert numbers(subscriber) == list(range(151))
    assert published.counts[:4] == (151, 0, 0, 1)
    with Subscriber(broker) as late:
        wait_for(lambda: len(late.messages) == 5)
        assert all(retain for _, _, retain in late.messages)
        kept = {topic.removeprefix(f"{TOPIC}/"): text for topic, text, _ in late.messages}
    assert kept.pop("driver") == "ended"
    kept = {name: json.loads(text) for name, text in kept.items()}
    assert (kept["state"]["mode"], kept["state"]["end"], kept["state"]["command"]) == ("off", "off", "run")
    faults = kept["faults"]
    assert (faults["any"], faults["fault_type"], faults["temperature_fault"]) == (True, "TripError", "open")
    assert (kept["publisher"]["samples"], kept["publisher"]["dropped"]) == (151, 0)


def test_command_whose_rig_does_not_open_publishes_nothing(broker):
    """Another program may drive the rig, and publish to the same topics."""
    with Subscriber(broker) as subscriber:
        with Published(broker.url) as refused:
            assert refused.publication.wait_for_broker()
        with Published(broker.url) as published:
            published.begin().tick(1)
        wait_for(lambda: subscriber.texts("driver")[-1:] == ["ended"])
    assert subscriber.texts("driver") == ["online", "ended"]
    assert refused.counts[:2] == (0, 0)


def tripped(published):
    """Publish 151 ticks, the last with faults, and trip."""
    with published:
        published.begin().tick(150)
        published.tick(device_faults=("over-temperature",), temperature_fault="open")
        raise Trip(Fault.OVER_TEMPERATURE, 7.5, "150 °C").error()


@pytest.mark.parametrize("end", [MosquittoBroker.stop, MosquittoBroker.hang], ids=["stopped", "hung"])
@pytest.mark.exhaustive
def test_samples_wait_for_a_broker_that_is_away(broker, end):
    with Published(broker.url) as published:
        published.begin().tick(20)
        wait_for(lambda: published.publication.counts.waiting == 0)
        end(broker)
        published.tick(30)
        wait_for(lambda: published.publication.counts.trouble)
        assert published.publication.counts.waiting == 30
        broker.resume() if broker.process else broker.start()
        with Subscriber(broker) as subscriber:
            wait_for(lambda: published.publication.counts.waiting == 0)
            published.tick(10)
            wait_for(lambda: {*range(50, 60)} <= {*numbers(subscriber)})
            wait_for(lambda: subscriber.texts("driver")[-1:] == ["online"])
    assert published.counts.samples == 60
    assert published.counts.dropped == 0
    assert published.counts.connections == 2


@pytest.mark.exhaustive
def test_killed_publisher_is_restarted_and_continues(broker):
    with Subscriber(broker) as subscriber, Published(broker.url) as published:
        published.begin().tick(20)
        wait_for(lambda: published.publication.counts.waiting == 0)
        os.kill(published.publication.pid, signal.SIGKILL)
        published.tick(20)
        wait_for(lambda: {*numbers(subscriber)} == {*range(40)})
        wait_for(lambda: subscriber.texts("driver") == ["online", "gone", "online"])
    assert published.counts[:4] == (40, 0, 0, 2)


@pytest.mark.exhaustive
def test_overwritten_samples_are_counted(tmp_path):
    broker = MosquittoBroker(tmp_path)
    with Published(broker.url) as published:
        published.begin().tick(CAPACITY + 100)
        with broker, Subscriber(broker) as subscriber:
            wait_for(lambda: published.publication.counts.waiting == 0)
            wait_for(lambda: numbers(subscriber)[-1:] == [CAPACITY + 99])  # the broker may still send the last ones
            counts = published.publication.counts
    assert counts.dropped == 101
    assert counts.samples == CAPACITY - 1


@pytest.mark.parametrize("is_permitted", [True, False])
def test_off_acts_only_where_the_rig_file_permits_it(broker, is_permitted):
    config = CONFIG.model_copy(update={"off_by_mqtt": is_permitted})
    stopped = threading.Event()
    with Subscriber(broker) as subscriber:
        subscriber.publish(f"{TOPIC}/off", "old", retain=True)
        with Published(broker.url, config) as published:
            published.publication.on_off = stopped.set
            published.begin().tick(5)
            wait_for(lambda: len(numbers(subscriber)) == 5)
            assert not stopped.is_set()
            subscriber.publish(f"{TOPIC}/off")
            published.tick(5)
            wait_for(lambda: len(numbers(subscriber)) == 10)
            if is_permitted:
                wait_for(stopped.is_set)
        assert stopped.is_set() == is_permitted


@pytest.mark.exhaustive
def test_password_and_tls(tmp_path):
    certificate, key, users, secret = (tmp_path / name for name in ("cert.pem", "key.pem", "users", "secret"))
    subprocess.run(
        [
            *("openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", "/CN=localhost"),
            *("-addext", "subjectAltName=IP:127.0.0.1", "-keyout", key, "-out", certificate),
        ],
        check=True,
        capture_output=True,
    )
    secret.write_text("s3cret")
    subprocess.run([mosquitto.program("mosquitto_passwd"), "-b", "-c", users, "lab", "s3cret"], check=True)
    lines = (f"certfile {certificate}", f"keyfile {key}", "allow_anonymous false", f"password_file {users}")
    with MosquittoBroker(tmp_path, lines) as broker:
        place, tail = f"127.0.0.1:{broker.port}", f"ca_file={certificate}"
        assert counts_at(f"mqtts://lab@{place}?{tail}&password_file={secret}")[:4] == (5, 0, 0, 1)
        assert counts_at(f"mqtts://lab@{place}?{tail}").samples == 0
        without_ca = counts_at(f"mqtts://{place}")
        assert without_ca.samples == 0
        assert "certificate" in without_ca.trouble


def counts_at(url):
    """The counts after five samples were published to the broker at `url`."""
    with Published(url) as published:
        published.publication.wait_for_broker()
        published.begin().tick(5)
    assert bool(published.counts.trouble) == (published.counts.samples == 0)
    return published.counts
