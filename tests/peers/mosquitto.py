"""mosquitto as a peer: a broker on loopback that a test starts, stops, hangs and restarts; and a subscriber."""

from __future__ import annotations

import contextlib
import getpass
import shutil
import signal
import socket
import subprocess
import threading
import time

PATIENCE_S = 120.0
"""A message that has not arrived after this time does not arrive."""


def program(name="mosquitto"):
    """The path of a program of mosquitto; None if it is not installed. Debian has it in /usr/sbin."""
    return shutil.which(name) or shutil.which(name, path="/usr/sbin")


def missing():
    """Why the peer cannot run; None when it can."""
    return None if program() else "needs the broker mosquitto (Debian package mosquitto)"


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class MosquittoBroker:
    """A broker with the configuration `lines`, at `port`. A context manager that ends the broker.

    With `remembers` it keeps the sessions of its subscribers, and their messages, when it is stopped and started again.
    """

    def __init__(self, folder, lines=("allow_anonymous true",), *, remembers=False):
        self.port = free_port()
        self._config = folder / "mosquitto.conf"
        memory = [f"persistence {str(remembers).lower()}", f"persistence_location {folder}/", "max_queued_messages 0"]
        user = f"user {getpass.getuser()}"  # a broker that is started by root gives up its rights
        self._config.write_text("\n".join([f"listener {self.port} 127.0.0.1", user, *memory, *lines]) + "\n")
        self.process = None

    @property
    def url(self):
        return f"mqtt://127.0.0.1:{self.port}"

    def __enter__(self):
        self.start()
        return self

    def __exit__(self, *_):
        if self.process is not None:
            self.resume()
            self.stop()

    def start(self):
        """Start the broker, and wait until it listens."""
        self.process = subprocess.Popen(
            [program(), "-c", str(self._config)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        wait_for(self._listens)

    def stop(self):
        self.process.terminate()
        self.process.wait()
        self.process = None

    def hang(self):
        self.process.send_signal(signal.SIGSTOP)

    def resume(self):
        self.process.send_signal(signal.SIGCONT)

    def _listens(self):
        with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", self.port), 1):
            return True
        return False


class Subscriber:
    """Collects all messages of a broker as (topic, text, retain). It reconnects by itself. A context manager.

    With a `name` it has a session: the broker keeps its messages while it is not connected.
    """

    def __init__(self, broker, name=""):
        from paho.mqtt.client import Client
        from paho.mqtt.enums import CallbackAPIVersion

        self.messages = []
        self._client = Client(CallbackAPIVersion.VERSION2, client_id=name, clean_session=not name)
        self._client.reconnect_delay_set(1, 1)
        self._is_subscribed = threading.Event()
        self._client.on_connect = lambda client, *_: client.subscribe("#", 1)
        self._client.on_subscribe = lambda *_: self._is_subscribed.set()
        self._client.on_message = self._received
        self._client.connect("127.0.0.1", broker.port)

    def __enter__(self):
        self._client.loop_start()
        assert self._is_subscribed.wait(PATIENCE_S)
        return self

    def __exit__(self, *_):
        self._client.disconnect()
        self._client.loop_stop()

    def _received(self, _client, _data, message):
        self.messages.append((message.topic, message.payload.decode(), message.retain))

    def publish(self, topic, text="", *, retain=False):
        """Publish a message, and wait until the broker has it."""
        self._client.publish(topic, text, 1, retain).wait_for_publish(PATIENCE_S)

    def texts(self, name):
        """The texts of the messages whose topic ends with `name`."""
        return [text for topic, text, _ in tuple(self.messages) if topic.endswith(f"/{name}")]


def wait_for(condition):
    """Wait until the condition is true, which must happen in `PATIENCE_S`."""
    give_up_s = time.monotonic() + PATIENCE_S
    while not (found := condition()):
        assert time.monotonic() < give_up_s
        time.sleep(0.02)
    return found
