"""The modules of Python that only POSIX systems have. Elsewhere every module of smadrive can still be imported.

Models, fits, logs and reports work on every system. Code that drives a rig needs file locks, terminals, signals between
processes and inherited descriptors. It calls `check_posix` before anything else. Without this call, the first use of a
`MissingModule` raises the same error.
"""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, NoReturn, TypeVar
from weakref import WeakSet

from smadrive.errors import ConfigError

T = TypeVar("T")

MODULES = ("fcntl", "grp", "pwd", "termios", "tty")


class MissingModule:
    """Stands for a module that this system lacks. The access to any attribute raises ConfigError."""

    def __init__(self, name: str) -> None:
        self.__name__ = name

    def __getattr__(self, attribute: str) -> NoReturn:
        """Raise the ConfigError that a rig cannot be driven on this system."""
        raise _not_posix(f"{self.__name__}.{attribute}")


def module_or_missing(name: str) -> object:
    """Return the module `name` of Python, or a MissingModule."""
    try:
        return importlib.import_module(name)
    except ImportError:
        return MissingModule(name)


if TYPE_CHECKING:
    import fcntl as fcntl  # noqa: PLC0414 (names of this module)
    import grp as grp  # noqa: PLC0414
    import pwd as pwd  # noqa: PLC0414
    import termios as termios  # noqa: PLC0414
    import tty as tty  # noqa: PLC0414
else:
    globals().update({name: module_or_missing(name) for name in MODULES})


def check_posix() -> None:
    """Raise ConfigError on a system that is not POSIX: a rig cannot be driven there."""
    if any(isinstance(globals()[name], MissingModule) for name in MODULES):
        raise _not_posix(", ".join(MODULES))


def released_in_children(release: Callable[[T], None]) -> WeakSet[T]:
    """Return an empty set. Every forked child calls `release` for each object in it.

    Systems without fork call nothing.
    """
    held: WeakSet[T] = WeakSet()

    def release_inherited() -> None:
        for one in tuple(held):
            release(one)

    if (register := getattr(os, "register_at_fork", None)) is not None:
        register(after_in_child=release_inherited)
    return held


class OwningProcess:
    """The process that has created this object, such as an open rig. `pid` is its id."""

    def __init__(self) -> None:
        self.pid = os.getpid()

    @property
    def is_present(self) -> bool:
        """True in the process itself; False in a forked child."""
        return os.getpid() == self.pid

    def check(self) -> None:
        """Raise ConfigError in a forked child.

        Parent and child would send requests on one link, and take each other's replies for their own.
        """
        if not self.is_present:
            raise ConfigError(
                "a forked child cannot use the rig of its parent",
                where="rig",
                value=f"opened in process {self.pid}",
                cure="use the rig only in the process that has opened it",
            )


def _not_posix(needed: str) -> ConfigError:
    return ConfigError(
        "driving a rig needs Linux or macOS; models, fits, logs and reports work here, too",
        where=sys.platform,
        value=f"no {needed}",
        cure="drive the rig from Linux; on Windows, WSL 2 is a Linux",
    )
