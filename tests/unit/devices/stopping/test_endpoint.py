"""The user of a driver, and every user who may open the port of its line, may stop it; nobody else may."""

import os
import socket
import subprocess
import uuid

import pytest

from smadrive.devices.stopping.endpoint import PeerProcess, address_of, listens, peer_of, port_path, who_may_open

OWNER, MEMBER, OTHER = 4001, 4002, 4003


@pytest.fixture
def line(tmp_path):
    """The line of a port that belongs to OWNER, and to a group that MEMBER is in."""
    port = tmp_path / "port"
    port.touch()
    if os.geteuid() != 0:
        pytest.skip("only root can give a port to another user")
    os.chown(port, OWNER, MEMBER)
    return f"serial://{port}"


@pytest.mark.parametrize(
    ("mode", "allowed"),
    [
        (0o600, {OWNER}),
        (0o660, {OWNER, MEMBER}),
        (0o666, {OWNER, MEMBER, OTHER}),
        (0o640, {OWNER}),
        (0o006, {OTHER}),
    ],
)
def test_permissions_of_the_port_decide_who_may_stop(line, mode, allowed):
    port_path(line).chmod(mode)
    peers = [PeerProcess(1, user, (user,)) for user in (OWNER, MEMBER, OTHER)]
    assert {peer.user_id for peer in peers if peer.may_stop(line)} == allowed
    assert PeerProcess(1, 0, (0,)).may_stop(line)


def test_supplementary_group_may_stop(line):
    port_path(line).chmod(0o660)
    assert PeerProcess(1, OTHER, (OTHER, MEMBER)).may_stop(line)


def test_user_of_the_driver_may_stop_whatever_the_port_permits(line, monkeypatch):
    port_path(line).chmod(0o600)
    assert not PeerProcess(1, OTHER, (OTHER,)).may_stop(line)
    monkeypatch.setattr(os, "geteuid", lambda: OTHER)
    assert PeerProcess(1, OTHER, (OTHER,)).may_stop(line)


def test_network_port_is_open_to_every_user():
    assert PeerProcess(1, OTHER, (OTHER,)).may_stop("tcp://127.0.0.1:502 unit 1")


def test_port_that_is_gone_keeps_nobody_from_stopping(tmp_path):
    assert PeerProcess(1, OTHER, (OTHER,)).may_stop(f"serial://{tmp_path}/gone")


@pytest.mark.parametrize(
    ("mode", "named"), [(0o600, {str(OWNER)}), (0o660, {str(OWNER), str(MEMBER)}), (0o060, {str(MEMBER)})]
)
def test_sentence_names_who_may_open_the_port(line, mode, named):
    port_path(line).chmod(mode)
    assert {word for word in who_may_open(line).split() if word.isdigit()} == named


def test_peer_is_the_process_at_the_other_end():
    here, there = socket.socketpair()
    with here, there:
        assert peer_of(here) == (os.getpid(), os.geteuid(), (os.getegid(), *os.getgroups()))


def test_group_that_no_table_of_users_lists_is_known():
    if os.geteuid() != 0:
        pytest.skip("only root can give a process other groups")
    address = f"\0{uuid.uuid4()}"
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(address)
        listening.listen()
        child = os.fork()
        if child == 0:
            os.setgroups([MEMBER])
            os.setgid(OTHER)
            os.setuid(OTHER)
            socket.socket(socket.AF_UNIX).connect(address)
            os._exit(0)
        with listening.accept()[0] as asker:
            assert peer_of(asker) == (child, OTHER, (OTHER, MEMBER))
    os.waitpid(child, 0)


def test_lines_have_different_addresses():
    assert address_of("serial:///dev/ttyUSB0") != address_of("serial:///dev/ttyUSB1")


def test_only_the_process_that_has_the_listening_socket_is_the_driver():
    address = address_of(f"serial:///{uuid.uuid4()}")
    with subprocess.Popen(["sleep", "60"]) as other, socket.socket(socket.AF_UNIX) as listening:
        listening.bind(address)
        listening.listen()
        assert listens(os.getpid(), address)
        assert not listens(other.pid, address)
        other.kill()
    assert not listens(os.getpid(), address)
