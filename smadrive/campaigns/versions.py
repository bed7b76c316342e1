"""The versions of the packages that compute the runs of a campaign: the provenance of its results."""

from __future__ import annotations

import platform
from importlib.metadata import version

PACKAGES = ("smadrive", "numpy", "scipy")


def versions() -> dict[str, str]:
    """Return the versions of Python and of `PACKAGES` by name."""
    return {"python": platform.python_version(), **{name: version(name) for name in PACKAGES}}
