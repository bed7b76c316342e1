"""The parts of a rig file that `off` needs: the addresses of the devices. The rest of the file may be wrong."""

from __future__ import annotations

from math import inf
from typing import Any, NamedTuple

from pydantic import Field

from smadrive.errors import ConfigError
from smadrive.files.config import Section, invalid_toml, read_config_text, validate
from smadrive.files.toml.repair import repaired_toml
from smadrive.rig.config import DeviceConfig, LimitsConfig, in_folder, rig_file

ADDRESS_KEYS = ("name", "profile", "url", "unit_id", "full_scale_a", "full_scale_v")
"""The keys of a device that `off` reads."""


class OffConfig(NamedTuple):
    """The subset of a rig file that `off` needs. `current_max_a` is infinite when the limits cannot be read.

    `mistakes` are errors of the file outside its devices. `device_mistake` is the first error in its devices, so an
    address may be wrong, or a device may be missing; it is None for a file without such an error.
    """

    name: str
    devices: tuple[DeviceConfig, ...]
    current_max_a: float
    mistakes: tuple[ConfigError, ...]
    device_mistake: ConfigError | None


class _OffSection(Section):
    """The keys of a rig file that switching off needs."""

    devices: tuple[DeviceConfig, ...] = Field(min_length=1)


def load_off_config(name: str) -> OffConfig:
    """Load devices and current limit of the rig file `name`, even if other parts are wrong or not valid TOML.

    ConfigError if the devices cannot be read.
    """
    path = rig_file(name)
    text = read_config_text(path)
    try:
        tables, repairs = repaired_toml(text)
    except (ValueError, RecursionError) as error:
        raise invalid_toml(error, path) from None
    errors = [(repair.table, invalid_toml(repair.error, path)) for repair in repairs]
    in_devices = [error for table, error in errors if table == "devices"]
    try:
        devices = validate(_address_tables(tables), _OffSection, where=str(path)).devices
    except ConfigError as error:
        raise (in_devices[0] if in_devices else error) from None
    return OffConfig(
        str(tables.get("name", path.stem)),
        in_folder(devices, path.parent),
        _current_max_a(tables),
        tuple(error for table, error in errors if table != "devices"),
        next(iter(in_devices), None),
    )


def _current_max_a(tables: dict[str, Any]) -> float:
    try:
        return validate(tables.get("limits", {}), LimitsConfig, where="limits").current_max_a
    except ConfigError:
        return inf


def _address_tables(tables: dict[str, Any]) -> dict[str, Any]:
    """Return the devices with only their address keys. A value of a wrong type stays, and the validation reports it."""
    devices = tables.get("devices")
    if isinstance(devices, list):
        devices = [_address_keys(device) if isinstance(device, dict) else device for device in devices]
    return {} if devices is None else {"devices": devices}


def _address_keys(device: dict[str, Any]) -> dict[str, Any]:
    return {key: device[key] for key in ADDRESS_KEYS if key in device}
