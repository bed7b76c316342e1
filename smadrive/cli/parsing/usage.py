"""The help of the commands: examples, and a placeholder such as FILE for the value of each option.

By default typer shows the Python type in place of the placeholder, even `<bool>` for a flag, which takes no value.
Here a flag shows nothing.
"""

from __future__ import annotations

from typing import Any

from typer.core import TyperCommand, TyperGroup

from smadrive.cli.parsing.values import checked_conversion

EXAMPLES = {
    "demo": ("smadrive demo", "smadrive demo --output-dir first-try --seed 3"),
    "list": ("smadrive list",),
    "scan": ("smadrive scan /dev/ttyUSB0", "smadrive scan tcp://192.168.1.10 --units 1-3,7"),
    "board": (
        "smadrive board check /dev/ttyUSB0",
        "smadrive board calibrate /dev/ttyUSB0 --log held.h5 --current 0.2981 --voltage 2.97",
    ),
    "probe": ("smadrive probe my-rig.toml", "smadrive probe simulated --trace traces"),
    "calibrate": (
        "smadrive calibrate my-rig.toml temperature --point ice --point boiling --pressure-hpa 985",
        "smadrive calibrate my-rig.toml displacement --point 0 --point 5 --point 10",
    ),
    "watch": (
        "smadrive watch my-rig.toml",
        "smadrive watch my-rig.toml --for 10 --json",
        "smadrive watch my-rig.toml --page",
        "smadrive watch my-rig.toml --publish mqtts://me@broker.lab/lab",
    ),
    "heat": (
        "smadrive heat my-rig.toml --current 0.2 --for 10",
        "smadrive heat my-rig.toml --temperature 60 --for 30 -o warm.h5",
    ),
    "excite": ("smadrive excite my-rig.toml -o excitation.h5",),
    "identify": (
        "smadrive identify excitation.h5 -o wire.json --plot fit.html",
        "smadrive identify wire.csv --output strain --kind duhem --components 1 -o wire.json",
    ),
    "simulate": ("smadrive simulate wire.json temperatures.csv -o displacements.csv",),
    "invert": ("smadrive invert wire.json displacements.csv -o temperatures.csv --start 22",),
    "run": (
        "smadrive run my-rig.toml --model wire.json --reference sine:low_mm=2,high_mm=9,period_s=56 -o run.h5",
        "smadrive run my-rig.toml --reference steps.csv --smooth -o steps.h5",
        "smadrive run my-rig.toml --reference sine:low_mm=2,high_mm=9,period_s=20,cycles=1 --repeat 100 -o part-1.h5",
        "smadrive run my-rig.toml --resume part-1.h5 -o part-2.h5",
        "smadrive run my-rig.toml --reference steps.csv -o steps.h5 --publish mqtt://broker.lab",
    ),
    "tune": ("smadrive tune my-rig.toml --model wire.json", "smadrive tune my-rig.toml --port 0 --no-browser"),
    "campaign": (
        "smadrive campaign diameter-and-rate -o diameter-and-rate",
        "smadrive campaign my-campaign.toml -o results --scheduler tcp://192.168.1.10:8786",
        "smadrive campaign my-campaign.toml -o results --resume",
    ),
    "report": ("smadrive report run.h5", "smadrive report run.h5 --csv run.csv", "smadrive report before.h5 after.h5"),
    "replay": ("smadrive replay run.h5 --model other.json",),
    "paper": ("smadrive paper --output-dir figures",),
    "off": ("smadrive off my-rig.toml", "smadrive off my-rig.toml --clear-faults"),
}

PLACEHOLDERS = {
    **dict.fromkeys(("log_file", "model_file", "output_file", "report_file", "plot", "csv", "model", "resume"), "FILE"),
    **dict.fromkeys(("folder", "output_dir", "trace"), "FOLDER"),
    **dict.fromkeys(("input_column", "output_column"), "COLUMN"),
    **dict.fromkeys(("sets", "memory", "components", "seed", "start", "port", "repeat", "workers"), "NUMBER"),
    "units": "IDS",
    "scheduler": "ADDRESS",
    "current_a": "A",
    "temperature_c": "C",
    "duration_s": "S",
    "reference": "CSV|SHAPE",
    "kind": "tsfuzzy|duhem",
    "displacement_from": "sensor|resistance|none",
}
"""The placeholder for the value of an option, by the name of its parameter."""


def epilog_of(command: str) -> str:
    """Return the examples of a command, which its help shows at its end."""
    return "\n\n".join(f"Example: {example}" for example in EXAMPLES[command])


class PlainCommand(TyperCommand):
    """A command whose help shows placeholders in place of types."""

    def get_params(self, *arguments: Any, **options: Any) -> Any:
        """Return the parameters, with their placeholders."""
        return _with_placeholders(super().get_params(*arguments, **options))


class PlainGroup(TyperGroup):
    """The group of all commands, whose help has the same placeholders."""

    def get_params(self, *arguments: Any, **options: Any) -> Any:
        """Return the parameters, with their placeholders."""
        return _with_placeholders(super().get_params(*arguments, **options))


def _with_placeholders(params: Any) -> Any:
    """Return the parameters with their placeholders, and with ConfigError for mistyped values."""
    for param in params:
        conversion = {} if "process_value" in vars(param) else {"process_value": checked_conversion(param)}
        vars(param).update(_shown_as(param) | conversion)
    return params


def _shown_as(param: Any) -> dict[str, object]:
    """Return the attributes that set what the help shows for the value of a parameter.

    This is the name of an argument, nothing for a flag, and a placeholder for another option.
    """
    if param.param_type_name == "argument":
        return {"metavar": param.name.upper(), "display_type_rich": _nothing}
    if getattr(param, "is_flag", False):
        return {"metavar": "", "display_type_rich": _nothing}
    return {"metavar": PLACEHOLDERS.get(param.name, param.name.upper())}


def _nothing(*_: object, **__: object) -> None:
    """Return None, so that the help shows no type for the parameter. It replaces `display_type_rich` of typer."""
