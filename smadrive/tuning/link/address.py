"""The address of the tuning page, which only this machine can reach."""

from __future__ import annotations

ADDRESS = "127.0.0.1"


def page_hosts(port: int) -> tuple[str, ...]:
    """Return the `Host` headers that a browser may send for the page on this port."""
    return tuple(f"{name}:{port}" for name in (ADDRESS, "localhost"))
