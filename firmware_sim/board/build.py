"""Builds the C code with `make`, once for each content of the sources and each set of variables.

The user's cache folder keeps every result. The name of its subfolder has a digest of the sources and the variables.
"""

from __future__ import annotations

import os
import subprocess
import tempfile
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import NamedTuple

from smadrive.errors import ConfigError

SOURCES = ("*.c", "*.h", "Makefile")


class Product(NamedTuple):
    """The file `name` that `make` builds in `folder` from the files in the folders `sources`.

    An error calls the product `subject`. `check_tools` raises ConfigError if a tool for the build is missing.
    """

    name: str
    subject: str
    folder: Path
    sources: tuple[Path, ...]
    check_tools: Callable[[], None]


def built(product: Product, *variables: str) -> Path:
    """Return the path of the product. Build the product first if it is not in the cache.

    `variables` are arguments of make, each as NAME=VALUE. ConfigError if a tool is missing or the build fails.
    """
    target = _cache_folder() / f"{Path(product.name).stem}-{_digest(product.sources, variables)}"
    if not (target / product.name).exists():
        product.check_tools()
        _make(product, variables, target)
    return target / product.name


def _cache_folder() -> Path:
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "smadrive"


def _digest(sources: tuple[Path, ...], variables: tuple[str, ...]) -> str:
    files = sorted(path for folder in sources for pattern in SOURCES for path in folder.glob(pattern))
    return sha256(b"\0".join((*map(str.encode, variables), *(path.read_bytes() for path in files)))).hexdigest()[:16]


def _make(product: Product, variables: tuple[str, ...], target: Path) -> None:
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        what, cure = "the folder of the built programs cannot be made", "set XDG_CACHE_HOME to a folder of yours"
        raise ConfigError(what, where=target.parent, value=error.strerror, cure=cure) from None
    with tempfile.TemporaryDirectory(dir=target.parent) as building:
        command = ["make", "-s", "-C", str(product.folder), f"BUILD={building}", *variables]
        made = subprocess.run(command, capture_output=True, text=True, check=False)
        if made.returncode:
            what = f"{product.subject} cannot be built"
            raise ConfigError(what, where=product.folder, value=made.stderr.strip()[-2000:])
        target.mkdir(exist_ok=True)
        (Path(building) / product.name).replace(target / product.name)  # no process loads a partial file
