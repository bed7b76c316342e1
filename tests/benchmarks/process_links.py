"""Links between the loop and a process beside it: the time that each link takes in a tick, and the delay of an OFF.

    .venv/bin/python tests/benchmarks/process_links.py [SECONDS]

A loop at 50 Hz requests 1.7 MB from a peer process, the size of a changed model with its controller, and unpacks it as
soon as it has arrived. The links alternate every second, so that other work of the machine affects all links equally.
The first figures are the time that a tick spends in the link, unpacking included. The last ones are the delay from an
OFF in the peer until the loop, which looks every 0.2 ms, sees it.

    memory      a descriptor of anonymous memory for each message, over a pair of Unix datagram sockets
    connection  multiprocessing.Pipe; poll, then recv
    pyzmq       PAIR sockets with NOBLOCK; OFF through PUSH and PULL with CONFLATE
"""

import mmap
import multiprocessing
import os
import pickle
import socket
import struct
import sys
import tempfile
import time
from contextlib import suppress

import numpy as np
import zmq

PERIOD_S, TURN_S = 0.02, 1.0
ANSWER = pickle.dumps([float(number) for number in range(190_000)])
REQUEST = bytes(36_000)
LOOK_S, OFFS = 0.0002, 200


class Memory:
    """The link by a descriptor of anonymous memory."""

    def __init__(self, _folder):
        self._ends = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)

    def join(self, end):
        self._socket = self._ends[end]
        self._socket.setblocking(False)
        return self._socket

    def send(self, content):
        memory = os.memfd_create("message")
        os.write(memory, content)
        socket.send_fds(self._socket, [b"."], [memory])
        os.close(memory)

    def receive(self):
        with suppress(BlockingIOError):
            memory = socket.recv_fds(self._socket, 1, 1)[1][0]
            with os.fdopen(memory, "rb") as file:
                file.seek(0)
                return file.read()


class Connection:
    """The link by multiprocessing.Pipe."""

    def __init__(self, _folder):
        self._ends = multiprocessing.Pipe()

    def join(self, end):
        self._connection = self._ends[end]
        return self._connection

    def send(self, content):
        self._connection.send_bytes(content)

    def receive(self):
        return self._connection.recv_bytes() if self._connection.poll() else None


class Zmq:
    """The link by pyzmq."""

    def __init__(self, folder):
        self._address = f"ipc://{folder}/pair"

    def join(self, end):
        self._socket = zmq.Context.instance().socket(zmq.PAIR)
        self._socket.connect(self._address) if end else self._socket.bind(self._address)
        return self._socket

    def send(self, content):
        with suppress(zmq.Again):
            self._socket.send(content, zmq.NOBLOCK)

    def receive(self):
        with suppress(zmq.Again):
            return self._socket.recv(zmq.NOBLOCK)


def answer(link):
    """Answer every request until killed."""
    poller = zmq.Poller()
    poller.register(link.join(1), zmq.POLLIN)
    while True:
        poller.poll()
        if link.receive() is not None:
            link.send(ANSWER)


def turn(link):
    """Return the milliseconds that each tick of one turn spends in the link."""
    spent_ms, is_free, due_s = [], True, time.monotonic()
    for _ in range(int(TURN_S / PERIOD_S)):
        due_s += PERIOD_S
        time.sleep(max(0.0, due_s - time.monotonic()))
        began_s = time.perf_counter()
        if is_free:
            link.send(REQUEST)
            is_free = False
        content = link.receive()
        if content is not None:
            pickle.loads(content)  # noqa: S301 (it is our own)
            is_free = True
        spent_ms.append(1e3 * (time.perf_counter() - began_s))
    return spent_ms


def off_by_memory(header, ready):
    for _ in range(OFFS):
        ready.wait()
        ready.clear()
        header[1] = time.monotonic_ns()
        header[0] += 1


def off_by_zmq(address, ready):
    sender = zmq.Context().socket(zmq.PUSH)
    sender.conflate = True
    sender.connect(address)
    time.sleep(0.5)
    for _ in range(OFFS):
        ready.wait()
        ready.clear()
        sender.send(struct.pack("q", time.monotonic_ns()), zmq.NOBLOCK)
    time.sleep(1.0)


def delays_ms(target, argument, received):
    """Return the delay of each OFF. `received()` is the time at which the OFF was sent, or None before its arrival."""
    context = multiprocessing.get_context("fork")
    ready, found = context.Event(), []
    peer = context.Process(target=target, args=(argument, ready))
    peer.start()
    time.sleep(0.6)
    for _ in range(OFFS):
        ready.set()
        while (sent_ns := received()) is None:
            time.sleep(LOOK_S)
        found.append(1e-6 * (time.monotonic_ns() - sent_ns))
    peer.join()
    return found


def memory_delays_ms():
    header = np.frombuffer(mmap.mmap(-1, 16), np.int64)
    count = 0

    def received():
        nonlocal count
        if header[0] == count:
            return None
        count += 1
        return int(header[1])

    return delays_ms(off_by_memory, header, received)


def zmq_delays_ms(folder):
    receiver = zmq.Context.instance().socket(zmq.PULL)
    receiver.conflate = True
    receiver.bind(f"ipc://{folder}/off")

    def received():
        with suppress(zmq.Again):
            return struct.unpack("q", receiver.recv(zmq.NOBLOCK))[0]

    return delays_ms(off_by_zmq, f"ipc://{folder}/off", received)


def report(name, values_ms):
    p50, p99 = np.percentile(values_ms, (50, 99))
    print(f"{name:34s} median {p50:7.3f} ms, p99 {p99:8.3f} ms, worst {max(values_ms):8.3f} ms", flush=True)


def main(seconds, folder):
    context = multiprocessing.get_context("fork")
    links = {"memory": Memory(folder), "connection": Connection(folder), "pyzmq": Zmq(folder)}
    peers = {name: context.Process(target=answer, args=(link,), daemon=True) for name, link in links.items()}
    for peer in peers.values():
        peer.start()
    for link in links.values():
        link.join(0)
    time.sleep(0.5)
    with suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(1))
    spent_ms = {name: [] for name in links}
    for _ in range(int(seconds / TURN_S)):
        for name, link in links.items():
            spent_ms[name] += turn(link)
    for name, values_ms in spent_ms.items():
        report(f"{name}, a tick", values_ms)
    for peer in peers.values():
        peer.kill()
    report("OFF through memory", memory_delays_ms())
    report("OFF through pyzmq", zmq_delays_ms(folder))
    print(f"load average {os.getloadavg()[0]:.1f}")


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        main(float(sys.argv[1]) if len(sys.argv) > 1 else 20.0, folder)
