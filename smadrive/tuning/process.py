"""The page process as the control process sees it: started, restarted when it dies, ended with the session.

It is told everything over its standard input, whose end tells it that the control process is gone, however it went.
A thread waits for it, so that its death and its new start take nothing from a tick.
"""

from __future__ import annotations

import json
import subprocess
import sys
import threading
import time
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from smadrive.errors import ConfigError
from smadrive.tuning.channel import ControlEnd

END_WITHIN_S = 3.0
RESTART_S = 0.5
"""Pause before a new start: a page that dies at once must not keep the machine busy."""


class PageProcess:
    """A context manager: `url` is where the page is while it lasts. ConfigError when it does not come up."""

    def __init__(self, channel: ControlEnd, *, port: int, token: str, rig_file: Path, folder: Path) -> None:
        self._channel = channel
        self._token = token
        self._told: dict[str, Any] = {
            "port": port,
            "token": token,
            "rig_file": str(rig_file),
            "folder": str(folder),
            "memory_fd": channel.memory_fd,
            "socket_fd": channel.page_socket.fileno(),
        }
        self._is_ending = threading.Event()
        self.restarts = 0

    @property
    def url(self) -> str:
        """The address of the page, with the token that allows to control."""
        return f"http://127.0.0.1:{self._told['port']}/?token={self._token}"

    @property
    def pid(self) -> int:
        """The present process."""
        return self._process.pid

    def __enter__(self) -> Self:
        """Start it and wait until it serves."""
        self._start()
        self._keeper = threading.Thread(target=self._keep, name="page keeper", daemon=True)
        self._keeper.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End it."""
        self._is_ending.set()
        self._hang_up()
        try:
            self._process.wait(END_WITHIN_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
        self._keeper.join(END_WITHIN_S)

    def _start(self) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", "smadrive.tuning.server"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            pass_fds=(self._channel.memory_fd, self._channel.page_socket.fileno()),
            start_new_session=True,  # Ctrl-C is the control process's: it switches off, then ends the page
        )
        if self._process.stdin is None or self._process.stdout is None:
            raise ConfigError("the page process has no standard input and output")
        try:
            self._process.stdin.write(json.dumps(self._told) + "\n")
            self._process.stdin.flush()
            self._told["port"] = json.loads(self._process.stdout.readline())["port"]
        except (OSError, ValueError):
            self._process.wait()
            self._hang_up()
            raise ConfigError(
                "the tuning page did not start: see above; is the port taken? choose another --port"
            ) from None

    def _hang_up(self) -> None:
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                pipe.close()

    def _keep(self) -> None:
        while True:
            self._process.wait()
            if self._is_ending.is_set():
                return
            self._hang_up()
            time.sleep(RESTART_S)
            try:
                self._start()
            except ConfigError:
                continue
            self.restarts += 1
