"""A rig file: which devices, which wire, which limits. What it may contain, and its loading."""

from __future__ import annotations

from collections.abc import Iterable
from math import inf
from pathlib import Path
from typing import Literal, NamedTuple, Self

from pydantic import Field, ValidationInfo, field_validator, model_validator

from smadrive.errors import ConfigError
from smadrive.files.config import Section, load_config, read_toml, validate
from smadrive.files.kinds import RIG
from smadrive.files.shipped import config_file


class DeviceConfig(Section):
    """One device of the rig: where it is, which profile describes it, and what of it the rig uses.

    `measures`: the quantities taken from it, all that its profile binds if left out. `rate_hz`: how often a measuring
    device is read, at every tick if left out, and never faster than it converts.

    `full_scale_a`, `full_scale_v`: what a board that is commanded by duty drives through this wire at 100 %.
    """

    name: str
    profile: str
    url: str
    unit_id: int | None = Field(default=None, ge=0, le=255)
    measures: tuple[Literal["temperature", "displacement"], ...] | None = None
    rate_hz: float | None = Field(default=None, gt=0)
    full_scale_a: float | None = Field(default=None, gt=0)
    full_scale_v: float | None = Field(default=None, gt=0)


class LimitsConfig(Section):
    """What must never be exceeded; every layer of safety takes its limits from here. Left out: not limited."""

    current_max_a: float = Field(gt=0)
    temperature_max_c: float = Field(le=600)
    voltage_max_v: float | None = Field(default=None, gt=0)
    temperature_min_c: float = Field(default=-20.0, ge=-100)
    watchdog_s: float = Field(gt=0, le=10)
    stale_after_s: float = Field(default=0.3, gt=0, le=10)
    displacement_min_mm: float | None = None
    displacement_max_mm: float | None = None
    tracking_max_mm: float | None = Field(default=None, gt=0)
    tracking_for_s: float = Field(default=2.0, gt=0)


class ExcitationConfig(Section):
    """Between which temperatures, and how fast, the identification experiment drives the wire."""

    low_c: float
    high_c: float
    rate_c_per_s: float = Field(gt=0)


class FeedbackConfig(Section):
    """How fast the temperature loop is; the gains follow from the heat balance.

    `closed_loop_s` is `LOOP_PERIODS` periods at the fastest if it is left out.
    `feedforward_share` of the feedforward's power is used: all of it, or less to see what the feedback does alone.
    `adapt` lets the tuning page's session adapt the rules to the measured displacement as soon as it is armed;
    nothing else adapts them.
    """

    closed_loop_s: float = Field(default=0.25, gt=0)
    integral_s: float = Field(default=2.0, gt=0)
    noise_c: float = Field(default=0.1, ge=1e-3, le=10)
    feedforward_share: float = Field(default=1.0, ge=0, le=1.5)
    adapt: bool = False


LOOP_PERIODS = 2.5
"""A temperature loop that shall settle in fewer of its own periods overshoots where the wire heats at full current."""


class RigConfig(Section):
    """A rig file."""

    name: str
    wire: str
    model: str | None = None
    rate_hz: float = Field(gt=0, le=200)
    devices: tuple[DeviceConfig, ...] = Field(min_length=1)
    limits: LimitsConfig
    excitation: ExcitationConfig
    feedback: FeedbackConfig = Field(default=FeedbackConfig(), validate_default=True)

    @field_validator("feedback")
    @classmethod
    def _no_faster_than_its_ticks(cls, feedback: FeedbackConfig, info: ValidationInfo) -> FeedbackConfig:
        """Unless the file says how fast the loop is, a slow rig gets a slower one."""
        if "rate_hz" not in info.data or "closed_loop_s" in feedback.model_fields_set:
            return feedback
        closed_loop_s = max(feedback.closed_loop_s, LOOP_PERIODS / info.data["rate_hz"])
        return feedback.model_copy(update={"closed_loop_s": closed_loop_s})

    @model_validator(mode="after")
    def _agree(self) -> Self:
        """Limits that contradict each other are refused before anything is heated."""
        limits, excitation = self.limits, self.excitation
        names = [device.name for device in self.devices]
        if len(set(names)) < len(names):
            raise ValueError(f"two devices have the same name ({', '.join(names)}): give each its own")
        if not excitation.low_c < excitation.high_c:
            raise ValueError(
                f"excitation.low_c = {excitation.low_c:g} must be below excitation.high_c = {excitation.high_c:g}"
            )
        if not excitation.high_c < limits.temperature_max_c:
            raise ValueError(
                f"excitation.high_c = {excitation.high_c:g} must be below "
                f"limits.temperature_max_c = {limits.temperature_max_c:g}, or the experiment trips its own protection"
            )
        for name, unit in (("temperature", "c"), ("displacement", "mm")):
            low, high = (getattr(limits, f"{name}_{end}_{unit}") for end in ("min", "max"))
            if low is not None and high is not None and not low < high:
                raise ValueError(
                    f"limits.{name}_min_{unit} = {low:g} must be below limits.{name}_max_{unit} = {high:g}"
                )
        if limits.watchdog_s < 2.0 / self.rate_hz:
            raise ValueError(
                f"limits.watchdog_s = {limits.watchdog_s:g} is shorter than two periods of the loop "
                f"({2.0 / self.rate_hz:g} s at rate_hz = {self.rate_hz:g}): raise it"
            )
        self.check_feedback(self.feedback)
        return self

    def check_feedback(self, feedback: FeedbackConfig) -> None:
        """ConfigError for gains faster than the ticks: they would switch between no current and the full one."""
        for name in ("closed_loop_s", "integral_s"):
            if getattr(feedback, name) < 1.0 / self.rate_hz:
                raise ConfigError(
                    f"rig '{self.name}': feedback.{name} = {getattr(feedback, name):g} is shorter than a period of the "
                    f"loop ({1.0 / self.rate_hz:g} s at rate_hz = {self.rate_hz:g}): raise it"
                )

    def in_folder(self, folder: Path) -> RigConfig:
        """The same rig with the files that it names, not those that ship, looked for from `folder`."""
        devices = _in_folder(self.devices, folder)
        model = None if self.model is None else str(folder / self.model)
        return self.model_copy(update={"wire": looked_for(folder, self.wire), "model": model, "devices": devices})

    def at(self, url: str) -> RigConfig:
        """The same rig with its devices at another address."""
        return self.model_copy(
            update={"devices": tuple(device.model_copy(update={"url": url}) for device in self.devices)}
        )


class RigAddresses(NamedTuple):
    """What leads to the devices of a rig, and what counts as no current there (infinite: not told)."""

    name: str
    devices: tuple[DeviceConfig, ...]
    current_max_a: float


class _Devices(Section):
    """As much of a rig file as who only switches off must understand."""

    devices: tuple[DeviceConfig, ...] = Field(min_length=1)


ADDRESS = ("name", "profile", "url", "unit_id", "full_scale_a", "full_scale_v")
"""The keys of a device by which it is reached."""


def _in_folder(devices: Iterable[DeviceConfig], folder: Path) -> tuple[DeviceConfig, ...]:
    return tuple(device.model_copy(update={"profile": looked_for(folder, device.profile)}) for device in devices)


def looked_for(folder: Path, name: str) -> str:
    """A path from `folder`, with the choice that may follow it, or the name of a shipped file as it is."""
    path = name.partition(":")[0]
    return str(folder / name) if path.endswith(".toml") else name


def load_rig(name: str) -> RigConfig:
    """The rig file at the path `name`, or the shipped rig of that name; the files it names count from its folder."""
    path = rig_file(name)
    return load_config(path, RigConfig).in_folder(path.parent)


def load_addresses(name: str) -> RigAddresses:
    """Where the devices of that rig file are, whatever is wrong with the rest of it. ConfigError when it tells none."""
    path = rig_file(name)
    tables = read_toml(path)
    told = tables.get("devices")
    if isinstance(told, list):
        told = [{key: one[key] for key in ADDRESS if key in one} if isinstance(one, dict) else one for one in told]
    devices = validate({"devices": told} if told is not None else {}, _Devices, where=str(path)).devices
    try:
        current_max_a = validate(tables.get("limits", {}), LimitsConfig, where=str(path)).current_max_a
    except ConfigError:
        current_max_a = inf
    return RigAddresses(str(tables.get("name", path.stem)), _in_folder(devices, path.parent), current_max_a)


def rig_file(name: str) -> Path:
    """Where that rig file is."""
    return config_file(name, RIG)
