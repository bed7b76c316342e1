"""The optional dependencies of smadrive, its extras: which packages they bring, and how to install them."""

from __future__ import annotations

import shlex
import sys
from importlib.util import find_spec

from smadrive.errors import ConfigError

PACKAGES = {
    "tune": {"bokeh": "bokeh", "tornado": "tornado", "zmq": "pyzmq"},
    "mqtt": {"paho": "paho-mqtt"},
    "campaign": {"distributed": "dask", "pandas": "pandas", "pyarrow": "pyarrow"},
}
"""For each extra, the modules that its users import, and the packages that bring them."""


def check_extra(extra: str, where: str) -> None:
    """Raise ConfigError if a package of `extra` is not installed. `where` is the option or page that needs it.

    Nothing is imported, so the check takes no time.
    """
    for module, package in PACKAGES[extra].items():
        found = find_spec(module)
        if found is None or found.origin is None:  # a folder without __init__.py is no package
            raise ConfigError(f"needs {package}", where=where, cure=install_cure(f"smadrive[{extra}]"))


def install_cure(requirement: str) -> str:
    """Return the cure for a missing package, such as `smadrive[tune]`: its installation for the Python that runs."""
    return f"install it with `{shlex.quote(sys.executable)} -m pip install {shlex.quote(requirement)}`"
