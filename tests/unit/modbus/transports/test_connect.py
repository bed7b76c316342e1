"""A malformed URL is a ConfigError in every function that reads a URL."""

import pytest

from smadrive.errors import ConfigError, TransportError
from smadrive.modbus.transports.connect import SCHEMES, open_transport, port_of

BAD = [
    "tcp://192.168.1..10:502",
    "tcp://[::1",
    "tcp://host\0:502",
    "serial:///dev/tty\0USB0",
    "tcp://host:99999999999999999999",
    "tcp://host:" + "9" * 5000,
    "tcp://" + "a" * 64 + ":502",
    "tcp://" + "a" * 2000 + ":502",
    "rtu+tcp://host:٥٠٢",
    "serial:///tmp/" + "a" * 300,
]

BAD_OPTIONS = [
    "baudrate=0",
    "baudrate=49",
    "baudrate=12000001",
    "baudrate=" + "9" * 5000,
    "baudrate=٩٦٠٠",
    "baudrate=9_600",
    "latency_ms=" + "9" * 5000,
    "latency_ms=٢٠٠",
]


@pytest.mark.parametrize("url", BAD)
@pytest.mark.parametrize("read", [open_transport, port_of])
def test_malformed_url_is_a_config_error_in_every_function(url, read):
    with pytest.raises(ConfigError) as caught:
        read(url)
    assert len(str(caught.value)) < 400


@pytest.mark.parametrize("option", BAD_OPTIONS)
@pytest.mark.parametrize("url", ["serial:///dev/no-such-port", "rtu+tcp://127.0.0.1:1"])
def test_option_out_of_bounds_is_a_config_error(url, option):
    with pytest.raises(ConfigError):
        open_transport(f"{url}?{option}")


@pytest.mark.parametrize("option", ["baudrate=50", "baudrate=12000000", "latency_ms=5000", "latency_ms=0"])
def test_option_at_its_bound_is_taken(option):
    with pytest.raises(TransportError):
        open_transport(f"serial:///dev/no-such-port?{option}")


@pytest.mark.parametrize("read", [open_transport, port_of])
def test_loop_of_links_is_a_config_error(tmp_path, read):
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    with pytest.raises(ConfigError):
        read(f"serial://{tmp_path}/loop")


@pytest.mark.parametrize("read", [open_transport, port_of])
@pytest.mark.parametrize(("scheme", "near"), [("seriel", "'serial'"), ("rtu+tpc", "'rtu+tcp'"), ("smb", "")])
def test_unknown_scheme_is_cured_by_the_nearest_and_all_known_schemes(read, scheme, near):
    with pytest.raises(ConfigError) as caught:
        read(f"{scheme}:///dev/ttyUSB0")
    assert caught.value.value == f"'{scheme}'"
    assert near in caught.value.cure
    assert scheme not in caught.value.cure
    assert all(f"{known}://" in caught.value.cure for known in SCHEMES)
