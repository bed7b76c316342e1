"""The address of the tuning page: on this machine alone."""

from __future__ import annotations

ADDRESS = "127.0.0.1"


def page_hosts(port: int) -> tuple[str, ...]:
    """The `Host` headers with which a browser asks for the page on this port."""
    return tuple(f"{name}:{port}" for name in (ADDRESS, "localhost"))
