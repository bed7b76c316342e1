"""`smadrive off`: put every device of a rig into its safe state, confirmed by read-back."""

from __future__ import annotations

from typing import Annotated

import typer

from smadrive.cli.output import AsJson, Output
from smadrive.cli.probe import RigFile
from smadrive.rig import Rig
from smadrive.rigconfig import load_rig

ClearFaults = Annotated[bool, typer.Option("--clear-faults", help="Also clear latched faults, their cause removed.")]


def main(rig: RigFile, clear_faults: ClearFaults = False, as_json: AsJson = False) -> None:
    """Switch the heater of RIG off, confirmed by reading back."""
    output = Output(as_json)
    config = load_rig(rig)
    with Rig(config, heats=False) as bench:  # entering a rig confirms its safe state, leaving it does so again
        measurement = bench.clear_faults() if clear_faults else bench.heater.exchange(0.0)
    names = [device.name for device in config.devices]
    output.say(f"{config.name}: heater off, confirmed by read-back ({', '.join(names)})")
    latched = [*measurement.device_faults, *filter(None, [bench.latch.told])]
    if latched:
        output.say(f"latched: {', '.join(latched)} (clear with --clear-faults)")
    output.result({"rig": config.name, "devices": names, "safe": True, "faults": latched})
