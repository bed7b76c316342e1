"""Pseudo-terminals and their links."""

import os
from pathlib import Path

from firmware_sim.bench import simulated_device
from firmware_sim.server.endpoint import Terminal


def test_a_link_of_a_killed_simulator_is_replaced_although_its_terminal_number_is_in_use_again(
    tmp_path, config, monkeypatch
):
    near, far = os.openpty()
    link = tmp_path / "port"
    link.symlink_to(os.ttyname(far))
    monkeypatch.setattr(os, "openpty", lambda: (near, far))  # the kernel gives the lowest number that is free
    terminal = Terminal(link, simulated_device(config).line.new_port(numbered=False))
    try:
        assert terminal.url == f"serial://{link}"
        assert Path(link).is_char_device()
    finally:
        terminal.close()
    assert not link.is_symlink()
