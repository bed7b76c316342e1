"""The ports at which a guardian looks for its device."""

import os
from contextlib import ExitStack
from pathlib import Path

import pytest

from smadrive.devices.guardian.search import AGREEING, ASK_AGAIN_S, PortSearch
from smadrive.devices.state import key as keys
from smadrive.devices.state.key import port_names


class Time:
    """A clock that the test advances."""

    now_s = 0.0

    def __call__(self):
        return self.now_s


@pytest.fixture
def now():
    return Time()


@pytest.fixture
def by_id(tmp_path, monkeypatch):
    folder = tmp_path / "by-id"
    folder.mkdir()
    monkeypatch.setattr(keys, "BY_ID", folder)
    return folder


def plug(by_id, number, name):
    """Plug in the adapter with this name; the kernel gives its port this number."""
    port = by_id.parent / f"ttyUSB{number}"
    port.touch()
    (by_id / name).unlink(missing_ok=True)
    (by_id / name).symlink_to(port)
    return port


def test_a_device_that_comes_back_under_another_number_is_found_and_another_adapter_is_not_touched(by_id, now):
    url = f"serial://{plug(by_id, 0, 'usb-1a86')}?baudrate=9600"
    search = PortSearch(url, port_names(url), now)
    assert search.urls() == [url]
    (by_id / "usb-1a86").unlink()
    plug(by_id, 0, "usb-cafe")
    assert search.urls() == []
    plug(by_id, 3, "usb-1a86")
    assert search.urls() == [f"serial://{by_id / 'usb-1a86'}?baudrate=9600"]


def test_port_without_a_permanent_name_is_tried_as_written(by_id, now):
    port = by_id.parent / "ttyUSB0"
    port.touch()
    search = PortSearch(f"serial://{port}", frozenset(), now)
    assert search.urls() == [f"serial://{port}"]
    port.unlink()
    assert search.urls() == []


def test_port_with_another_device_is_not_tried_for_a_while(now):
    url = "tcp://gateway:502"
    search = PortSearch(url, port_names(url), now)
    for _ in range(AGREEING):
        assert search.urls() == [url]
        search.note_other_device(url)
    assert search.urls() == []
    now.now_s += ASK_AGAIN_S
    assert search.urls() == [url]
    search.note_other_device(url)
    assert search.urls() == []


def test_one_wrong_identity_does_not_exclude_a_port(now):
    url = "tcp://gateway:502"
    search = PortSearch(url, port_names(url), now)
    for _ in range(3 * AGREEING):
        search.note_other_device(url)
        search.note_no_device(url)
        assert search.urls() == [url]


def test_port_that_is_plugged_in_again_is_tried_at_once(by_id, now):
    url = f"serial://{plug(by_id, 0, 'usb-1a86')}"
    search = PortSearch(url, port_names(url), now)
    for _ in range(AGREEING):
        search.note_other_device(url)
    assert search.urls() == []
    plug(by_id, 1, "usb-1a86")
    assert search.urls() == [f"serial://{by_id / 'usb-1a86'}"]


def test_only_a_pseudo_terminal_without_a_name_is_gone_for_good(tmp_path, now):
    near, far = os.openpty()
    url, link = f"serial://{os.ttyname(far)}", tmp_path / "folder" / "port"
    link.parent.mkdir()
    link.symlink_to(os.ttyname(far))
    bare, named = (
        PortSearch(url, port_names(url), now),
        PortSearch(f"serial://{link}", port_names(f"serial://{link}"), now),
    )
    assert [bare.is_gone, named.is_gone] == [False, False]
    os.close(near)
    os.close(far)
    assert bare.is_gone
    assert not named.is_gone
    link.unlink()
    link.parent.rmdir()
    assert named.is_gone
    assert not PortSearch("tcp://gateway:502", port_names("tcp://gateway:502"), now).is_gone


def test_pseudo_terminal_with_changed_permissions_is_not_gone(now):
    near, far = os.openpty()
    url = f"serial://{os.ttyname(far)}"
    search = PortSearch(url, port_names(url), now)
    Path(os.ttyname(far)).chmod(0o622)
    assert not search.is_gone
    assert search.urls() == [url]
    os.close(near)
    os.close(far)
    assert search.is_gone
    assert search.urls() == []


def test_left_over_link_to_another_pseudo_terminal_is_not_tried(tmp_path, now):
    near, far = os.openpty()
    link, name = tmp_path / "port", os.ttyname(far)
    link.symlink_to(name)
    url = f"serial://{link}"
    search = PortSearch(url, port_names(url), now)
    assert search.urls() == [url]
    os.close(near)
    os.close(far)
    with ExitStack() as stack:
        while not Path(name).exists():
            for end in os.openpty():
                stack.callback(os.close, end)
        assert search.urls() == []
        link.unlink()
        link.symlink_to(name)
        assert search.urls() == [url]
