"""The settings of a move as a configuration of bluesky."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from smadrive.errors import ConfigError
from smadrive.files.spelling import suggestion_or_list
from smadrive.scripting.move_options import MoveOptions, move_options

UNITS = {"speed_mm_per_s": "mm/s", "tolerance_mm": "mm", "settle_s": "s", "timeout_s": "s"}


@dataclass(frozen=True)
class SmaWireSettings:
    """The options of a move of a wire with this smallest and greatest displacement, in mm."""

    limits_mm: tuple[float, float]
    options: MoveOptions

    @classmethod
    def for_limits(cls, limits_mm: tuple[float, float]) -> SmaWireSettings:
        """Return the default settings for a wire with these limits."""
        return cls(limits_mm, move_options(limits_mm))

    def changed(self, **settings: float) -> SmaWireSettings:
        """Return the settings with some changed. ConfigError for an unknown name, and as `move_options` raises it."""
        names = MoveOptions._fields
        for name in settings:
            if name not in names:
                cure = suggestion_or_list(name, names)
                raise ConfigError("unknown setting", where="configure", value=name, cure=cure)
        return SmaWireSettings(self.limits_mm, move_options(self.limits_mm, **{**self.options._asdict(), **settings}))

    def read(self, device: str, texts: Mapping[str, str]) -> dict[str, dict[str, Any]]:
        """Return the settings and `texts` as readings of a device."""
        now_s = time.time()
        values = {**self.options._asdict(), **texts}
        return {f"{device}_{name}": {"value": value, "timestamp": now_s} for name, value in values.items()}

    def describe(self, device: str, texts: Sequence[str]) -> dict[str, dict[str, Any]]:
        """Return the data keys of `read`. `texts` are the names of the texts that `read` gets."""
        numbers = {
            name: {"source": f"smadrive:{device}", "dtype": "number", "shape": [], "units": unit}
            for name, unit in UNITS.items()
        }
        names = {name: {"source": f"smadrive:{device}", "dtype": "string", "shape": []} for name in texts}
        return {f"{device}_{name}": key for name, key in {**numbers, **names}.items()}
