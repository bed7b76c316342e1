"""Python programs as processes whose imports are done already.

`Program` and `run` take the place of `subprocess.Popen` and `subprocess.run` for `python -m MODULE ...` and
`python -c CODE ...`. One server per test process imports the modules of `IMPORTED` once and forks a child for every
program. The child has the arguments, folder, environment and standard streams that it was given. What is not tested
this way is the start itself and the teardown of the interpreter; tests of these use `subprocess`.
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
    """Return the connection to the server of this process. The server ends when the connection is closed."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with theirs:
        command = [sys.executable, __file__, str(theirs.fileno())]
        _running.append(subprocess.Popen(command, pass_fds=[theirs.fileno()], start_new_session=True))
    return ours


_running = []


def end_server():
    """End the server of this process, if there is one."""
    if _running:
        server().close()
        server.cache_clear()
        _running.pop().wait()


def _next_program(control):
    """Return the request that this forked child must run. In the server, return only when its client is gone."""
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # the waiting processes, below, leave nothing behind
    while True:
        message, streams, _, _ = socket.recv_fds(control, MOST_BYTES, 4)
        if not message:
            sys.exit()
        if os.fork():
            for stream in streams:
                os.close(stream)
        elif not _is_forked_again(streams[0]):
            control.detach()
            return json.loads(message), streams[1:]


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


def _serve(control):
    for name in IMPORTED:
        importlib.import_module(name)
    gc.collect()
    gc.freeze()
    (arguments, *surroundings), streams = _next_program(control)
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
    _serve(socket.socket(fileno=int(sys.argv[1])))
