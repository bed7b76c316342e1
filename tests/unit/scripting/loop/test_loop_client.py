"""The link of a script to its loop process is used by several threads: a request and the commands of a servo."""

import threading
from multiprocessing import Pipe

import pytest

from smadrive.scripting.loop.loop_client import LoopClient
from smadrive.scripting.loop.messages import COMMAND

LONG, MANY = 100_000, 200
"""Length of the messages, which are longer than one write to a pipe, and their number per thread."""


@pytest.fixture
def client():
    client = LoopClient()
    to_process = client._connection
    yield client
    client._connection = to_process
    client.end()


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
