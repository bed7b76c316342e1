"""The entries that `scan` prints for a rig file."""

import tomllib

from smadrive.rig.config import DeviceConfig, RigConfig, load_rig
from smadrive.rig.ports.discovery import DiscoveredDevice, rig_entries

URL = "serial:///dev/ttyUSB0?baudrate=9600&parity=N&stopbits=1"


def found(unit_id, *proved):
    return DiscoveredDevice(unit_id, "9600 8N1", URL, proved, () if proved else ("autonics-tk",))


def test_entries_are_valid_together():
    devices = [found(1, "riden-rd60xx"), found(3, "delta-dtb"), found(4), found(5, "delta-dtb")]
    entries = tomllib.loads("\n".join(rig_entries(devices)))["devices"]
    document = load_rig("bench-supply").model_dump(exclude_none=True, exclude={"feedback"})
    config = RigConfig.model_validate(document | {"devices": entries})
    assert config.devices == tuple(
        DeviceConfig(name=name, profile=profile, url=URL, unit_id=unit_id)
        for name, profile, unit_id in (
            ("riden-rd60xx", "riden-rd60xx", 1),
            ("delta-dtb-3", "delta-dtb", 3),
            ("delta-dtb-5", "delta-dtb", 5),
        )
    )


def test_only_device_on_its_line_has_no_unit_id():
    (entry,) = rig_entries([found(None, "tclab")])
    assert tomllib.loads(entry)["devices"] == [{"name": "tclab", "profile": "tclab", "url": URL}]
