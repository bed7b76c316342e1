"""The settings of a move as a configuration of bluesky."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from typing import Any

from smadrive.errors import ConfigError
from smadrive.files.spelling import suggestion_or_list
from smadrive.scripting.move_options import default_speed_and_tolerance

UNITS = {"speed_mm_per_s": "mm/s", "tolerance_mm": "mm", "settle_s": "s", "timeout_s": "s"}


@dataclass(frozen=True)
class SmaWireSettings:
    """The options of `Servo.move`."""

    speed_mm_per_s: float
    tolerance_mm: float
    settle_s: float = 1.0
    timeout_s: float = 30.0

    @classmethod
    def for_limits(cls, limits_mm: tuple[float, float]) -> SmaWireSettings:
        """Return the default settings for a wire with this smallest and greatest displacement, in mm."""
        return cls(*default_speed_and_tolerance(limits_mm))

    def options(self) -> dict[str, Any]:
        """Return the settings as options of `Servo.move`."""
        return asdict(self)

    def changed(self, **settings: float) -> SmaWireSettings:
        """Return the settings with some changed. ConfigError for an unknown name."""
        names = [field.name for field in fields(self)]
        for name in settings:
            if name not in names:
                cure = suggestion_or_list(name, names)
                raise ConfigError("unknown setting", where="configure", value=name, cure=cure)
        return replace(self, **settings)

    def read(self, device: str, texts: Mapping[str, str]) -> dict[str, dict[str, Any]]:
        """Return the settings and `texts` as readings of a device."""
        now_s = time.time()
        values = {**asdict(self), **texts}
        return {f"{device}_{name}": {"value": value, "timestamp": now_s} for name, value in values.items()}

    def describe(self, device: str, texts: Sequence[str]) -> dict[str, dict[str, Any]]:
        """Return the data keys of `read`. `texts` are the names of the texts that `read` gets."""
        numbers = {
            name: {"source": f"smadrive:{device}", "dtype": "number", "shape": [], "units": unit}
            for name, unit in UNITS.items()
        }
        names = {name: {"source": f"smadrive:{device}", "dtype": "string", "shape": []} for name in texts}
        return {f"{device}_{name}": key for name, key in {**numbers, **names}.items()}
