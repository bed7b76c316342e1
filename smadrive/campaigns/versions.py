"""The versions of the packages that decide the table of a campaign: the provenance of its results."""

from __future__ import annotations

import platform
from collections.abc import Callable
from functools import cache
from importlib.metadata import version
from typing import TypeVar

from smadrive.errors import ConfigError

ResultT = TypeVar("ResultT")

COMPUTING = ("smadrive", "numpy", "scipy")
"""The packages that compute the runs, on each worker."""

WRITING = ("pandas", "pyarrow")
"""The packages that write the table. The command needs them, a worker does not."""


@cache
def versions() -> dict[str, str]:
    """Return the versions of Python and of `COMPUTING` by name. Workers and command must have the same ones."""
    return {"python": platform.python_version(), **{name: version(name) for name in COMPUTING}}


@cache
def table_versions() -> dict[str, str]:
    """Return the versions of Python and of all packages that decide the table and its digest, by name."""
    return versions() | {name: version(name) for name in WRITING}


def with_versions(required: dict[str, str], task: Callable[..., ResultT], *arguments: object) -> ResultT:
    """Return `task(*arguments)`. ConfigError if this process has other versions than `required`.

    Every task of a campaign is executed by this function, because a worker can join the cluster at any time.
    """
    own = versions()
    for name, number in required.items():
        check_version(name, own[name], number, f"worker on {platform.node()}")
    return task(*arguments)


def check_version(name: str, found: object, required: str, where: str) -> None:
    """Raise ConfigError if a worker has another version of `name` than the command, so its runs may differ."""
    if found != required:
        raise ConfigError(
            f"another version of {name} than that of this command, so its runs may differ",
            where=where,
            value=str(found),
            limit=required,
            cure=f"install {name} {required} on all workers",
        )
