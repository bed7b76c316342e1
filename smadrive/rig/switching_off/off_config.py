"""The parts of a rig file that `off` needs: devices with their addresses, and the current limit if it can be read.

The rest of the file may be wrong.
"""

from __future__ import annotations

from math import inf
from typing import Any, NamedTuple

from smadrive.devices.heating.zero_current import CURRENT_ZERO_A
from smadrive.devices.state.key import DeviceKey
from smadrive.errors import ConfigError
from smadrive.files.config import invalid_toml, read_config_text, validate
from smadrive.files.toml.repair import repaired_toml
from smadrive.rig.config import DeviceConfig, in_folder, rig_file
from smadrive.rig.switching_off.addresses import keys_in

ADDRESS_KEYS = ("name", "profile", "url", "unit_id")
"""The keys of a device that `off` reads."""

CURE = "write [[devices]] above each device"

ANY_WIRE = f"Up to {1000 * CURRENT_ZERO_A:g} mA count as no current, which may still heat a thin wire"


class OffConfig(NamedTuple):
    """The subset of a rig file that `off` needs.

    devices           the devices that can be read
    keys              keys of all addresses in the text of the file (see `keys_in`)
    current_max_a     current limit in A; infinite if it cannot be read
    mistakes          errors in the current limit, and TOML errors of the file outside its devices
    device_mistake    first error in the devices, so an address may be wrong or a device may be missing; None: no error
    """

    name: str
    devices: tuple[DeviceConfig, ...]
    keys: tuple[DeviceKey, ...]
    current_max_a: float
    mistakes: tuple[ConfigError, ...]
    device_mistake: ConfigError | None


def load_off_config(name: str) -> OffConfig:
    """Load devices and current limit of the rig file `name`, as far as they can be read.

    ConfigError if the file cannot be read at all.
    """
    path = rig_file(name)
    text = read_config_text(path)
    try:
        tables, repairs = repaired_toml(text)
    except (ValueError, RecursionError) as error:
        return OffConfig(path.stem, (), keys_in(text), inf, (), invalid_toml(error, path))
    errors = [(repair.table, invalid_toml(repair.error, path)) for repair in repairs]
    in_devices = [error for table, error in errors if table == "devices"]
    devices, unreadable = _devices(tables.get("devices"), str(path))
    current_max_a, unlimited = _current_max_a(tables, str(path))
    return OffConfig(
        str(tables.get("name", path.stem)),
        in_folder(devices, path.parent),
        keys_in(text),
        current_max_a,
        (*unlimited, *(error for table, error in errors if table != "devices")),
        next(iter([*in_devices, *unreadable]), None),
    )


def _devices(given: Any, where: str) -> tuple[list[DeviceConfig], list[ConfigError]]:
    """Return the valid devices, and an error for each invalid device.

    A single table is used as one device, and gives an error, too.
    """
    tables = given if isinstance(given, list) else [given]
    devices, errors = list[DeviceConfig](), list[ConfigError]()
    if not isinstance(given, list):
        errors.append(ConfigError("the devices are not a list of tables", where=where, cure=CURE))
    for number, table in enumerate(tables):
        try:
            devices.append(validate(_address_keys(table), DeviceConfig, where=f"{where}: devices.{number}"))
        except ConfigError as error:
            errors.append(error)
    return devices, errors


def _current_max_a(tables: dict[str, Any], where: str) -> tuple[float, list[ConfigError]]:
    """Return the current limit, A, even if other limits are wrong. If it is wrong: inf, and the error."""
    limits = tables.get("limits")
    given = limits.get("current_max_a") if isinstance(limits, dict) else None
    if isinstance(given, int | float) and not isinstance(given, bool) and 0.0 < given < inf:
        return float(given), []
    return inf, [ConfigError(f"the current limit cannot be read. {ANY_WIRE}", where=f"{where}: limits.current_max_a")]


def _address_keys(device: Any) -> Any:
    """Return a device with only `ADDRESS_KEYS`. If `device` is no table, return it as it is: its validation fails."""
    return {key: device[key] for key in ADDRESS_KEYS if key in device} if isinstance(device, dict) else device
