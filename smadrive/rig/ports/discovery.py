"""Finds the devices on a line that belongs to no rig yet, and writes their entries for a rig file."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from urllib.parse import parse_qsl, urlencode

from smadrive.devices.profile.profile import load_profile
from smadrive.devices.scan import scan
from smadrive.files.shipped import configs_dir
from smadrive.modbus.transports.transport import SerialSettings


@dataclass(frozen=True)
class DiscoveredDevice:
    """A device that answered a scan.

    unit_id     unit id on the line; None for a device without one
    line        line settings as text, for example `115200 8N1`; empty if the URL sets them or leads over a network
    url         URL of the port, with the line settings
    proved      profiles that the answers of the device prove
    possible    profiles that the answers do not exclude; empty if a profile is proved
    """

    unit_id: int | None
    line: str
    url: str
    proved: tuple[str, ...]
    possible: tuple[str, ...]


def rig_entries(devices: Sequence[DiscoveredDevice]) -> list[str]:
    """Return the entries of the devices in a rig file, without the devices that prove no profile.

    A device is named after its profile. If several devices have the same profile, their unit ids follow, because each
    device of a rig needs a name of its own.
    """
    proved = [device for device in devices if device.proved]
    counts = Counter(device.proved[0] for device in proved)
    return [_rig_entry(device, is_alone=counts[device.proved[0]] == 1) for device in proved]


def _rig_entry(device: DiscoveredDevice, *, is_alone: bool) -> str:
    profile = device.proved[0]
    name = profile if is_alone else f"{profile}-{device.unit_id}"
    entry = f'[[devices]]\nname = "{name}"\nprofile = "{profile}"\nurl = "{device.url}"'
    return entry if device.unit_id is None else f"{entry}\nunit_id = {device.unit_id}\n"


def port_url(port: str) -> str:
    """Return the URL of a port. `port` is a URL, a path, or the name of a port in /dev."""
    path = Path("/dev") / port
    return port if "://" in port or not ("/" in port or path.exists()) else f"serial://{path}"


def discover(port: str, unit_ids: Sequence[int], ask: Callable[[str, int], None]) -> list[DiscoveredDevice]:
    """Find the devices at `port` (see `port_url`) by all shipped profiles, and return them. Nothing is written to them.

    `ask(line, unit_id)` is called before a unit is asked. BusyError when another process uses the port.
    """
    port = port_url(port)
    profiles = [load_profile(file) for file in sorted((configs_dir() / "devices").glob("*.toml"))]
    devices = []
    for found in scan(port, unit_ids, profiles, ask):
        line, url = ("", port) if found.line is None else (str(found.line), _url_with(port, found.line))
        devices.append(DiscoveredDevice(found.unit_id, line, url, found.proved, found.possible))
    return devices


def _url_with(url: str, settings: SerialSettings) -> str:
    """Return the URL of a serial port with these line settings in place of its own. Its other options stay."""
    port, _, query = url.partition("?")
    options = dict(parse_qsl(query)) | {name: str(value) for name, value in asdict(settings).items()}
    return f"{port}?{urlencode(options)}"
