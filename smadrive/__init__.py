"""smadrive: a driver that moves a shape-memory-alloy wire to a displacement setpoint.

For scripts and notebooks (docs/python.md):

    import smadrive

    with smadrive.open_rig("in-process") as rig:
        wire = smadrive.identify(rig.excite())
        run = rig.track(smadrive.sine(low_mm=2, high_mm=9, period_s=56), wire)

The code is in the subpackages, which docs/architecture.md describes. A name is imported when it is first used: this
file imports nothing, so that `smadrive off` starts at once.
"""

from typing import TYPE_CHECKING

__all__ = [
    "Command",
    "IdentifiedWire",
    "Measurement",
    "OpenRig",
    "Reference",
    "Run",
    "__version__",
    "chirp",
    "identify",
    "load_wire",
    "open_rig",
    "read_log",
    "sine",
    "staircase",
    "steps",
    "trapezoid",
    "triangle",
]

if TYPE_CHECKING:
    from smadrive.control.controllers.interface import Command
    from smadrive.control.references.reference import Reference
    from smadrive.control.references.shapes import chirp, sine, staircase, steps, trapezoid, triangle
    from smadrive.measurement import Measurement
    from smadrive.scripting.open_rig import OpenRig, open_rig
    from smadrive.scripting.run import Run, read_log
    from smadrive.scripting.wire import identify, load_wire
    from smadrive.wire.identified_wire import IdentifiedWire

    __version__: str
else:
    _MODULES = {
        "control.controllers.interface": ("Command",),
        "control.references.reference": ("Reference",),
        "control.references.shapes": ("chirp", "sine", "staircase", "steps", "trapezoid", "triangle"),
        "measurement": ("Measurement",),
        "scripting.open_rig": ("OpenRig", "open_rig"),
        "scripting.run": ("Run", "read_log"),
        "scripting.wire": ("identify", "load_wire"),
        "wire.identified_wire": ("IdentifiedWire",),
    }

    def __getattr__(name: str) -> object:
        """Import a public name when it is first used (PEP 562)."""
        if name == "__version__":
            from importlib.metadata import version  # noqa: PLC0415

            value = version("smadrive")
        else:
            module = next((module for module, names in _MODULES.items() if name in names), None)
            if module is None:
                raise AttributeError(f"module 'smadrive' has no attribute '{name}'", name=name, obj=None)
            from importlib import import_module  # noqa: PLC0415

            value = getattr(import_module(f"smadrive.{module}"), name)
        globals()[name] = value
        return value

    def __dir__() -> list[str]:
        """Return the public names, and the names of this module that exist already."""
        return sorted({*globals(), *__all__})
