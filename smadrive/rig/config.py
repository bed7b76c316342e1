"""The rig file, with devices, wire, limits, excitation and feedback: its schema, and the functions that load it."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Literal, Self

from pydantic import Field, ValidationInfo, field_validator, model_validator

from smadrive.devices.calibration import CalibrationConfig
from smadrive.errors import ConfigError
from smadrive.files.config import Section, load_config
from smadrive.files.kinds import RIG
from smadrive.files.shipped import config_file
from smadrive.measurement import DisplacementFrom

ZERO_C_IN_K = 273.15


class DeviceConfig(Section):
    """One device of the rig: its address, its profile, and its use.

    measures        quantities that the rig takes from this device; by default all for which the profile has a register
    rate_hz         rate at which a sensor is read; by default at every tick, and never faster than the loop runs or
                    the sensor converts
    full_scale_a    for a board that is commanded by duty: current in A through this wire at 100 %
    full_scale_v    for a board that is commanded by duty: voltage in V at this wire at 100 %
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
    """The limits of the rig, which every safety layer uses. A limit that is None does not apply.

    temperature_min_c    a reading below this temperature in °C is a fault
    watchdog_s           device or guardian switches the heater off after this time in s without a command
    stale_after_s        longest time in s between two measurements
    tracking_max_mm      largest difference between setpoint and displacement in mm
    tracking_for_s       time in s for which the difference may be larger, or the displacement may be unknown
    """

    current_max_a: float = Field(gt=0)
    temperature_max_c: float = Field(le=600)
    voltage_max_v: float | None = Field(default=None, gt=0)
    temperature_min_c: float = Field(default=-20.0, ge=-100)
    watchdog_s: float = Field(gt=0, le=10)
    stale_after_s: float = Field(default=0.3, gt=0, le=10)
    displacement_min_mm: float | None = None
    displacement_max_mm: float | None = None
    tracking_max_mm: float | None = Field(default=None, gt=0)
    tracking_for_s: float = Field(default=2.0, gt=0, le=60)


class ExcitationConfig(Section):
    """The identification experiment: its lowest and highest temperature, its rate, and its plan.

    plan          `nested` for shrinking inner loops, `forc` for first-order reversal curves
    reversals     nested: number of inner loops from each end of the range; forc: number of falling curves
    duration_s    longest duration of the path in s; may replace `reversals`: the path has as many reversals as fit
    """

    low_c: float
    high_c: float
    rate_c_per_s: float = Field(gt=0)
    plan: Literal["nested", "forc"] = "nested"
    reversals: int | None = Field(default=None, ge=2, le=40)
    duration_s: float | None = Field(default=None, gt=0, le=86_400)

    @model_validator(mode="after")
    def _one_size(self) -> Self:
        if self.reversals is not None and self.duration_s is not None:
            raise ValueError(
                f"reversals = {self.reversals} and duration_s = {self.duration_s:g} exclude each other: give one"
            )
        return self


class FeedbackConfig(Section):
    """The speed of the temperature loop; its gains follow from the heat balance.

    closed_loop_s        time constant of the closed loop in s; by default 0.25, or `LOOP_PERIODS` periods if longer
    integral_s           integral time in s
    noise_c              least noise of the thermocouple that the controller assumes, K; it assumes the noise in the
                         record of the wire if that is larger
    feedforward_share    fraction of the feedforward's power that is used; less than 1 leaves more to the feedback
    adapt                if True, `tune` adapts the rules of the model to the measured displacement while the session is
                         armed; other commands ignore this key
    """

    closed_loop_s: float = Field(default=0.25, gt=0)
    integral_s: float = Field(default=2.0, gt=0)
    noise_c: float = Field(default=0.1, ge=1e-3, le=10)
    feedforward_share: float = Field(default=1.0, ge=0, le=1.5)
    adapt: bool = False


LOOP_PERIODS = 2.5
"""A temperature loop with a time constant of fewer periods overshoots when the wire heats at full current."""


class RigConfig(Section):
    """The content of a rig file.

    `displacement_from` is the source of the displacement in a run: `sensor`, `resistance` or `none`. If `off_by_mqtt`
    is True, a message at the topic `off` stops a command that publishes to a broker (docs/telemetry.md).
    """

    name: str
    wire: str
    model: str | None = None
    rate_hz: float = Field(gt=0, le=200)
    devices: tuple[DeviceConfig, ...] = Field(min_length=1)
    limits: LimitsConfig
    excitation: ExcitationConfig
    feedback: FeedbackConfig = Field(default_factory=FeedbackConfig, validate_default=True)
    calibration: CalibrationConfig = CalibrationConfig()
    off_by_mqtt: bool = False
    displacement_from: DisplacementFrom = DisplacementFrom.SENSOR

    @field_validator("feedback")
    @classmethod
    def _no_faster_than_its_ticks(cls, feedback: FeedbackConfig, info: ValidationInfo) -> FeedbackConfig:
        """Return the feedback. By default `closed_loop_s` is at least `LOOP_PERIODS` periods of the loop."""
        if "rate_hz" not in info.data or "closed_loop_s" in feedback.model_fields_set:
            return feedback
        closed_loop_s = max(feedback.closed_loop_s, LOOP_PERIODS / info.data["rate_hz"])
        return feedback.model_copy(update={"closed_loop_s": closed_loop_s})

    @model_validator(mode="after")
    def _agree(self) -> Self:
        """Return the rig. Raise an error for names, excitation, limits or feedback that contradict each other."""
        self._check_names()
        self._check_excitation()
        self._check_limits()
        self.check_feedback(self.feedback)
        return self

    def _check_names(self) -> None:
        names = [device.name for device in self.devices]
        if len(set(names)) < len(names):
            raise ValueError(f"two devices have the same name ({', '.join(names)}): give each device its own name")

    def _check_excitation(self) -> None:
        low_c, high_c, limit_c = self.excitation.low_c, self.excitation.high_c, self.limits.temperature_max_c
        if not low_c < high_c:
            raise ValueError(f"excitation.low_c = {low_c:g} must be below excitation.high_c = {high_c:g}")
        if not high_c < limit_c:
            raise ValueError(
                f"excitation.high_c = {high_c:g} must be below limits.temperature_max_c = {limit_c:g}, or the "
                f"experiment would trip the supervisor{kelvin_hint(high_c, self.limits.temperature_min_c, limit_c)}"
            )

    def _check_limits(self) -> None:
        limits = self.limits
        for name, unit in (("temperature", "c"), ("displacement", "mm")):
            low, high = (getattr(limits, f"{name}_{end}_{unit}") for end in ("min", "max"))
            if low is not None and high is not None and not low < high:
                raise ValueError(
                    f"limits.{name}_min_{unit} = {low:g} must be below limits.{name}_max_{unit} = {high:g}"
                )
        if limits.watchdog_s < 2.0 / self.rate_hz:
            raise ValueError(
                f"limits.watchdog_s = {limits.watchdog_s:g} is shorter than two periods of the loop "
                f"({2.0 / self.rate_hz:g} s at rate_hz = {self.rate_hz:g}): raise watchdog_s"
            )

    def check_feedback(self, feedback: FeedbackConfig) -> None:
        """Raise ConfigError if a time constant is below a period: the current would jump between zero and full."""
        for name in ("closed_loop_s", "integral_s"):
            if getattr(feedback, name) < 1.0 / self.rate_hz:
                raise ConfigError(
                    f"feedback.{name} is shorter than a period of the loop",
                    where=f"rig '{self.name}'",
                    value=f"{getattr(feedback, name):g} s",
                    limit=f"{1.0 / self.rate_hz:g} s at rate_hz = {self.rate_hz:g}",
                    cure=f"raise feedback.{name}",
                )

    def in_folder(self, folder: Path) -> RigConfig:
        """Return the same rig with its relative paths joined to `folder`. Names of shipped files stay."""
        devices = in_folder(self.devices, folder)
        model = None if self.model is None else str(folder / self.model)
        return self.model_copy(update={"wire": path_or_name(folder, self.wire), "model": model, "devices": devices})

    def at(self, url: str) -> RigConfig:
        """Return the same rig with all devices at `url`."""
        return self.model_copy(
            update={"devices": tuple(device.model_copy(update={"url": url}) for device in self.devices)}
        )


def kelvin_hint(value: float, low_c: float, high_c: float) -> str:
    """Return a hint that `value` may be in kelvin if it would then lie in `low_c` to `high_c`, otherwise ""."""
    value_c = value - ZERO_C_IN_K
    return f". Is it in kelvin? {value:g} K is {value_c:.0f} °C" if low_c < value_c <= high_c else ""


def in_folder(devices: Iterable[DeviceConfig], folder: Path) -> tuple[DeviceConfig, ...]:
    """Return the devices with the relative paths of their profiles joined to `folder`."""
    return tuple(device.model_copy(update={"profile": path_or_name(folder, device.profile)}) for device in devices)


def path_or_name(folder: Path, name: str) -> str:
    """Return the path `name` joined to `folder`, or a shipped name as it is. The variant of a profile (`:J`) stays."""
    path = name.partition(":")[0]
    return str(folder / name) if path.endswith(".toml") else name


def load_rig(name: str) -> RigConfig:
    """Load the rig file at the path `name`, or the shipped rig of that name; ConfigError if it is wrong.

    Paths in a rig file are relative to its folder.
    """
    path = rig_file(name)
    return load_config(path, RigConfig).in_folder(path.parent)


def rig_file(name: str) -> Path:
    """Return the path of a rig file. `name` is a path or the name of a shipped rig; ConfigError if there is none."""
    return config_file(name, RIG)
