"""The link of a script to its loop process is used by several threads: a request and the commands of a servo."""

import contextlib
import os
import signal
import threading
from multiprocessing import Pipe

import pytest
from marks import exhaustive

from smadrive.scripting.loop.client.loop_client import LoopClient
from smadrive.scripting.loop.messages import COMMAND, Result

LONG, MANY = 100_000, 200
"""Length of the messages, which are longer than one write to a pipe, and their number per thread."""
FULL = 10_000_000
"""Length of a message that a pipe cannot hold, so that its sender waits for the reader."""


@pytest.fixture
def client():
    client = LoopClient()
    to_process = client._connection
    yield client
    client._connection = to_process
    client.end()


@pytest.mark.exhaustive
def test_messages_of_two_threads_arrive_whole(client):
    client._connection, far = Pipe()
    arrived = []

    def send(letter):
        for _ in range(MANY):
            client._send(COMMAND + letter * LONG)

    reader = threading.Thread(target=lambda: arrived.extend(far.recv_bytes() for _ in range(2 * MANY)))
    threads = [reader, *(threading.Thread(target=send, args=(letter,)) for letter in (b"a", b"b"))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    client._connection.close()
    far.close()
    assert {len(message) for message in arrived} == {len(COMMAND) + LONG}
    assert all(len(set(message[len(COMMAND) :])) == 1 for message in arrived)


@pytest.fixture
def far(client):
    """Replace the link of the client by a pipe, and yield its far end."""
    client._connection, far = Pipe()
    yield far
    client._connection.close()
    far.close()


def signal_while_sending(far, number, then=lambda: None):
    """Start a thread that waits for the first bytes of a message, signals the main thread, and calls `then`."""

    def act():
        far.poll(None)
        signal.pthread_kill(threading.main_thread().ident, number)
        then()

    thread = threading.Thread(target=act)
    thread.start()
    return thread


def has_ended(far):
    """Read what has arrived at the far end, and return True if nothing can follow."""
    while far.poll(0):
        if not os.read(far.fileno(), FULL):
            return True
    return False


def test_interruption_does_not_cut_a_message(client, far):
    arrived = []
    reader = signal_while_sending(far, signal.SIGINT, lambda: arrived.extend(far.recv_bytes() for _ in range(2)))
    with pytest.raises(KeyboardInterrupt):
        client._send(COMMAND + bytes(FULL))
    client._send(COMMAND + b"stop")
    client._connection.close()
    reader.join()
    assert [len(message) for message in arrived] == [len(COMMAND) + FULL, len(COMMAND + b"stop")]


@pytest.mark.parametrize("error", [exhaustive(ValueError), TimeoutError])
def test_cut_message_ends_the_loop_process(client, far, error):
    def fail(_number, _frame):
        raise error

    handler = signal.signal(signal.SIGUSR1, fail)
    try:
        sender = signal_while_sending(far, signal.SIGUSR1)
        with contextlib.suppress(ValueError):
            client._send(COMMAND + bytes(FULL))
        sender.join()
    finally:
        signal.signal(signal.SIGUSR1, handler)
    client._send(COMMAND + b"stop")
    assert has_ended(far)


class Interrupting:
    """An argument that cannot be pickled; Ctrl-C is pressed while this is tried."""

    def __reduce__(self):
        signal.raise_signal(signal.SIGINT)
        raise ValueError


def test_interruption_is_not_lost_if_pickling_fails(client):
    with pytest.raises(KeyboardInterrupt) as caught:
        client.call(Interrupting())
    assert "cannot be transferred" in caught.value.args[0]


@pytest.mark.exhaustive
def test_client_is_busy_until_the_reply_arrives(client, far):
    calling = threading.Thread(target=client.call, args=(None,))
    calling.start()
    far.recv_bytes()
    assert client.is_busy
    client._replies[client._number] = Result(None)
    calling.join()
    assert not client.is_busy
