"""A device of a rig file with its profile: its task, and the quantities that the rig takes from it.

The rig takes from a device every quantity that its profile has a register for, or only the quantities in the list
`measures` of the rig file. The list is needed because an input without a sensor shows a value, too.
"""

from __future__ import annotations

from dataclasses import dataclass

from smadrive.devices.heating.board import HeaterBoard
from smadrive.devices.heating.supply import BenchSupply
from smadrive.devices.heating.tclab import TCLab
from smadrive.devices.profile.profile import Profile, load_profile
from smadrive.errors import ConfigError
from smadrive.modbus.transports.connect import latency_s_of
from smadrive.rig.config import DeviceConfig

SIMULATED = "sim://"
"""The scheme of simulated devices. They end with this process: they need no guardian, and their trips are not kept."""


def profile_text(name: str) -> str:
    """Return the content of a profile as JSON. `name` is a path or the name of a shipped profile.

    Comments and defaults do not change the text. ConfigError if the profile is missing or wrong.
    """
    return load_profile(name).model_dump_json()


@dataclass(frozen=True)
class PlannedDevice:
    """A device of the rig file and its profile. If `is_given` is True, the caller supplies the connection."""

    config: DeviceConfig
    profile: Profile
    is_given: bool = False

    @property
    def name(self) -> str:
        """The name of the device in the rig file."""
        return self.config.name

    @property
    def where(self) -> str:
        """The name of the device in error messages."""
        return f"device '{self.name}'"

    @property
    def heats(self) -> bool:
        """True if the device drives current through the wire."""
        return self.profile.profile.heats

    @property
    def is_simulated(self) -> bool:
        """True if the device has no port: it is simulated in this process, or the caller gives its connection."""
        return self.is_given or self.config.url.startswith(SIMULATED)

    @property
    def unit_id(self) -> int:
        """The unit id in the rig file, or the factory setting of the device if the file has none."""
        return self.profile.unit_id if self.config.unit_id is None else self.config.unit_id

    @property
    def reply_timeout_s(self) -> float:
        """The longest time in which the device replies, with the latency of its connection, s."""
        latency_s = 0.0 if self.is_simulated else latency_s_of(self.config.url)
        return self.profile.timing.response_timeout_ms / 1e3 + latency_s

    @property
    def source_type(self) -> type[HeaterBoard | BenchSupply | TCLab]:
        """The class of heat source for this device."""
        if not self.profile.has_registers:
            return TCLab
        return HeaterBoard if self.profile.profile.role == "heater" else BenchSupply

    def measures(self, quantity: str) -> bool:
        """Return True if the rig takes `quantity` from this device.

        ConfigError if `measures` names a quantity that the profile lacks. The resistance of the wire follows from
        current and voltage of the device that heats.
        """
        if quantity == "resistance":
            return self.heats and self.profile.roles.measure_resistance
        has_register = getattr(self.profile.roles, quantity) is not None
        if self.config.measures is None:
            return has_register
        if quantity in self.config.measures and not has_register:
            raise ConfigError(
                f"the profile '{self.config.profile}' has no {quantity} register",
                where=self.where,
                cure=f'remove "{quantity}" from `measures` of this device',
            )
        return quantity in self.config.measures

    @property
    def source_measures(self) -> frozenset[str]:
        """The quantities that the rig takes from this heat source, besides current and voltage."""
        own = self.source_type.measures
        return own if self.config.measures is None else own.intersection(self.config.measures)


def check_full_scales(source: PlannedDevice) -> None:
    """Raise ConfigError if full scales are set for a source in amperes, or missing for a source commanded by duty."""
    scales = source.config.full_scale_a, source.config.full_scale_v
    if source.source_type is TCLab and None in scales:
        raise ConfigError(
            f"'{source.config.profile}' is commanded by duty and needs full scales",
            where=source.where,
            cure="set full_scale_a and full_scale_v to current and voltage at this wire at 100 % duty",
        )
    if source.source_type is not TCLab and scales != (None, None):
        raise ConfigError(
            f"'{source.config.profile}' is commanded in amperes and has no full scales",
            where=source.where,
            cure="remove full_scale_a and full_scale_v",
        )
