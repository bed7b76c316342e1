"""Pseudo-terminals and their links."""

import os
from pathlib import Path

from firmware_sim.bench import simulated_device
from firmware_sim.server.pty_endpoint import PtyEndpoint


def test_stale_link_is_replaced_when_its_pseudo_terminal_number_is_reused(tmp_path, config, monkeypatch):
    near, far = os.openpty()
    link = tmp_path / "port"
    link.symlink_to(os.ttyname(far))
    monkeypatch.setattr(os, "openpty", lambda: (near, far))  # the kernel assigns the lowest free number
    endpoint = PtyEndpoint(link, simulated_device(config).line.new_port(numbered=False))
    try:
        assert endpoint.url == f"serial://{link}"
        assert Path(link).is_char_device()
    finally:
        endpoint.close()
    assert not link.is_symlink()
