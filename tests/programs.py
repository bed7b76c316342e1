"""Python programs as processes whose imports are done already.

`Program` and `run` take the place of `subprocess.Popen` and `subprocess.run` for `python -m MODULE ...` and
`python -c CODE ...`. One server, which all workers of a test run share, imports the modules of `IMPORTED` once and
forks a child for every program. The child has the arguments, folder, environment and standard streams that it was
given. What is not tested this way is the start itself and the teardown of the interpreter; tests of these use
`subprocess`.
"""

import atexit
import gc
import importlib
import inspect
import json
import os
import pty
import resource
import runpy
import select
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from contextlib import suppress
from functools import cache
from pathlib import Path

COMMANDS = ("calibrate", "demo", "excite", "heat", "identify", "off", "probe", "report", "run", "scan", "watch")
IMPORTED = (
    *("numpy", "scipy.optimize", "h5py", "pydantic", "serial", "pymodbus.pdu", "cloudpickle", "tomlkit"),
    *("scipy.signal", "typer", "typer.rich_utils", "rich.markdown", "rich.padding", "rich.progress", "rich.table"),
    *("firmware_sim.cli", "smadrive.scripting.open_rig"),
    *("smadrive.cli.parsing.app", "smadrive.cli.terminal.table", *(f"smadrive.cli.{name}" for name in COMMANDS)),
)
STATUS = struct.Struct("i")
MOST_BYTES = 2**17
"""Largest size of a request, which is arguments, environment and folder as JSON."""
FIRST_CLIENT_WITHIN_S = 60.0
"""A server without a client ends after this time in s."""
CONNECTS_WITHIN_S = 60.0


class Program(subprocess.Popen):
    """A process that the server forks. It is a `Popen` that starts its process, and learns its end, in another way."""

    def _execute_child(self, *values):
        given = inspect.signature(super()._execute_child).bind(*values).arguments
        pairs = [("p2cread", 0), ("c2pwrite", 1), ("errwrite", 2)]
        streams = [given[name] if given[name] != -1 else inherited for name, inherited in pairs]
        environment = dict(os.environ if given["env"] is None else given["env"])
        limit = resource.getrlimit(resource.RLIMIT_NOFILE)
        request = [list(map(str, given["args"])), str(given["cwd"] or Path.cwd()), environment, limit]
        self._status, theirs = socket.socketpair()
        with theirs:
            socket.send_fds(server(), [json.dumps(request).encode()], [theirs.fileno(), *streams])
        (self.pid,) = STATUS.unpack(self._status.recv(STATUS.size))
        self._child_created = True
        self._close_pipe_fds(*(given[name] for name in inspect.signature(self._close_pipe_fds).parameters))

    def _try_wait(self, wait_flags):
        if wait_flags == os.WNOHANG and not select.select([self._status], [], [], 0)[0]:
            return 0, 0
        with self._status:
            return self.pid, *STATUS.unpack(self._status.recv(STATUS.size))

    def _internal_poll(self, *_, **__):
        if self.returncode is None and self._waitpid_lock.acquire(blocking=False):
            try:
                pid, status = (0, 0) if self.returncode is not None else self._try_wait(os.WNOHANG)
                if pid == self.pid:
                    self._handle_exitstatus(status)
            finally:
                self._waitpid_lock.release()
        return self.returncode


def run(arguments, *, capture_output=False, check=False, input=None, **options):  # noqa: A002
    """Run a `Program` to its end, as `subprocess.run` does."""
    if capture_output:
        options |= {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    if input is not None:
        options |= {"stdin": subprocess.PIPE}
    with Program(arguments, **options) as program:
        done = subprocess.CompletedProcess(arguments, None, *program.communicate(input))
        done.returncode = program.returncode
    if check:
        done.check_returncode()
    return done


def run_on_terminal(arguments, cwd):
    """Run a program whose stderr is a terminal, and return what the terminal got. The program must succeed."""
    client, slave = pty.openpty()
    environment = {**os.environ, "TERM": "xterm", "COLUMNS": "120"}
    with Program(arguments, cwd=cwd, env=environment, stdout=subprocess.PIPE, stderr=slave) as program:
        os.close(slave)
        seen = b""
        while True:
            try:
                seen += os.read(client, 65536)
            except OSError:  # the program has ended and closed its end
                break
        program.communicate()
    os.close(client)
    assert program.returncode == 0
    return seen.decode()


def lives(pid):
    """Return True if the process exists and is not a zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def open_files(pid):
    """Return the targets of the open descriptors of a process, without those that it closes meanwhile."""
    found = set()
    for one in Path(f"/proc/{pid}/fd").iterdir():
        with suppress(FileNotFoundError):
            found.add(str(one.readlink()))
    return found


@cache
def server():
    """Return the connection to the server of this test run. The server ends when its last connection is closed.

    A worker that finds no server starts one. Of several that start at once, all but the first find the address in use
    and end.
    """
    name = "programs of " + os.environ.get("PYTEST_XDIST_TESTRUNUID", f"process {os.getpid()}")
    connection = _seqpacket()
    give_up_s = time.monotonic() + CONNECTS_WITHIN_S
    while True:
        try:
            connection.connect(f"\0{name}")
        except ConnectionRefusedError:
            if time.monotonic() > give_up_s:
                raise
            if not _started or _started[-1].poll() is not None:
                _started.append(_start(name))
            time.sleep(0.01)
        else:
            return connection


_started = []


def _start(name):
    command = [sys.executable, __file__, name]
    return subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, start_new_session=True)


def end_server():
    """Close the connection of this process to the server. Wait for the server if this process has started it."""
    if server.cache_info().currsize:
        server().close()
        server.cache_clear()
    while _started:
        _started.pop().wait()


def _seqpacket():
    return socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)


def _next_program(listener):
    """Return the request that this forked child must run. In the server, return only when its last client is gone."""
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # the waiting processes, below, leave nothing behind
    clients = []
    while ready := select.select([listener, *clients], [], [], None if clients else FIRST_CLIENT_WITHIN_S)[0]:
        if listener in ready:
            clients.append(listener.accept()[0])
        for client in clients[:]:
            if client not in ready:
                continue
            message, streams, _, _ = socket.recv_fds(client, MOST_BYTES, 4)
            if not message:
                clients.remove(client)
                client.close()
            elif os.fork():
                for stream in streams:
                    os.close(stream)
            elif not _is_forked_again(streams[0]):
                for one in (listener, *clients):
                    one.detach()
                return json.loads(message), streams[1:]
        if not clients:
            break
    sys.exit()


def _is_forked_again(status):
    """Fork the program, and return False in it. The parent process reports the program's id and its exit, and ends."""
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    pid = os.fork()
    if pid:
        os.closerange(0, status)
        os.closerange(status + 1, os.sysconf("SC_OPEN_MAX"))
        os.write(status, STATUS.pack(pid))
        os.write(status, STATUS.pack(os.waitpid(pid, 0)[1]))
        os._exit(0)
    return False


def _become(folder, environment, limit, streams):
    """Give this process its own arguments, folder, environment and streams. Its modules are imported already."""
    for stream, number in zip(streams, range(3), strict=True):
        os.dup2(stream, number)
    os.closerange(3, os.sysconf("SC_OPEN_MAX"))
    resource.setrlimit(resource.RLIMIT_NOFILE, tuple(limit))
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    sys.stdin = sys.__stdin__ = open(0, closefd=False)  # noqa: SIM115
    sys.stdout = sys.__stdout__ = open(1, "w", closefd=False)  # noqa: SIM115
    sys.stderr = sys.__stderr__ = open(2, "w", buffering=1, errors="backslashreplace", closefd=False)  # noqa: SIM115
    sys.path[0] = folder


def _run(_python, kind, what, *arguments):
    """Run a module or a text, as `python -m` or `python -c` does."""
    sys.argv = [what if kind == "-m" else kind, *arguments]
    if kind == "-m":
        sys.modules.pop(what, None)
        runpy.run_module(what, run_name="__main__", alter_sys=True)
    elif kind == "-c":
        exec(compile(what, "<string>", "exec"), {"__name__": "__main__"})  # noqa: S102
    else:
        raise ValueError(kind)


def _end(status):
    """Wait for the threads, call the functions of `atexit`, flush the streams, and end without a teardown.

    The teardown would write to nearly every page that this process shares with the server: that takes 90 ms.
    """
    threading._shutdown()
    atexit._run_exitfuncs()
    with suppress(OSError, ValueError, AttributeError):
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)
    sys.exit(status)  # a stream cannot be flushed: the interpreter reports it


def _serve(name):
    listener = _seqpacket()
    try:
        listener.bind(f"\0{name}")
    except OSError:  # another worker has started the server
        return
    listener.listen(64)
    for module in IMPORTED:
        importlib.import_module(module)
    gc.collect()
    gc.freeze()
    (arguments, *surroundings), streams = _next_program(listener)
    _become(*surroundings, streams)
    status = 0
    try:
        _run(*arguments)
    except SystemExit as end:
        if not isinstance(end.code, int | None):
            raise
        status = end.code or 0
    _end(status)


if __name__ == "__main__":
    _serve(sys.argv[1])
